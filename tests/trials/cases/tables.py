"""CSV tables."""

from datetime import datetime, timedelta, timezone

import numpy as np

from lib.arm import ARM
from lib.session import rows_of, write_robot
from lib.trial import CELL, RECORDINGS, REPORT, Answer, Trial, count, done, explain, info, init, near, refused, replay
from lib.writers import start_of, write_table

NUMBERS = range(1, len(ARM.names) + 1)


def tables(write):
    """`write(recording, rows, path)` writes each table and what belongs to it."""

    def make(folder):
        write_robot(folder)
        for recording in range(RECORDINGS):
            write(recording, rows_of(recording), folder / f"free_{recording + 1}.csv")

    return make


def columns_file(path, text):
    path.with_suffix(".columns.yaml").write_text(text)


def quoted(unit, factor):
    """Headers with a comma and a unit in quotes."""
    positions = [f"Position, J{n} [{unit}]" for n in NUMBERS]
    torques = [f"Torque, J{n} [Nm]" for n in NUMBERS]

    def write(_, rows, path):
        header = ",".join(["t [s]", *(f'"{name}"' for name in positions + torques)])
        write_table(path, header, [rows.t, *(factor * rows.q).T, *rows.tau.T])
        columns_file(
            path,
            f"header: true\ntime: {{name: 't [s]'}}\nposition: {{names: {positions}}}\n"
            f"effort: {{names: {torques}}}\njoints: {ARM.names}\n",
        )

    return write


def decimal_commas(_, rows, path):
    """As a spreadsheet of a German Windows writes it: semicolons, decimal commas, CRLF."""
    names = [f"{what}{n}" for what in ("q", "tau") for n in NUMBERS]
    write_table(path, ";".join(["t", *names]), [rows.t, *rows.q.T, *rows.tau.T], ";", ",", "\r\n")
    joints = ", ".join(ARM.names)
    columns_file(
        path,
        "header: true\ndelimiter: ';'\ntime: {name: t}\nposition: {first: 2}\neffort: {first: 7}\n"
        f"joints: [{joints}]\n",
    )


def layout(name, times, form="{:.6f}"):
    """The layout in which the Python module gives recordings, without a columns file."""
    fields = ("position", "velocity", "effort")

    def write(recording, rows, path):
        header = ",".join([name, *(f"{joint}.{field}" for joint in ARM.names for field in fields)])
        values = [column[:, k] for k in range(len(ARM.names)) for column in (rows.q, rows.qd, rows.tau)]
        write_table(path, header, [times(recording, rows), *values], form=form)

    return write


def stamps_ns(recording, rows):
    return [str(start_of(recording) + round(t * 1e9)) for t in rows.t]


def iso(recording, rows):
    return [moment(recording, t).strftime("%Y-%m-%dT%H:%M:%S.%fZ") for t in rows.t]


def moment(recording, seconds):
    begin = datetime.fromtimestamp(start_of(recording) // 10**9, timezone.utc)
    return begin + timedelta(microseconds=round(seconds * 1e6))


def date_and_time(recording, rows, path):
    """Date and time of day in columns of their own."""
    moments = [moment(recording, t) for t in rows.t]
    date, day = ([m.strftime(form) for m in moments] for form in ("%Y-%m-%d", "%H:%M:%S.%f"))
    names = [f"{what}{n}" for what in ("q", "tau") for n in NUMBERS]
    write_table(path, ",".join(["Date", "Time", *names]), [date, day, *rows.q.T, *rows.tau.T])
    columns_file(
        path,
        "header: true\ntime: {name: Time}\nposition: {first: 3}\neffort: {first: 8}\n"
        f"joints: [{', '.join(ARM.names)}]\n",
    )


def episodes(recording, rows, path):
    """Two episodes in one table: the time begins again at 0."""
    second = rows_of(recording, shift=40)
    both = [np.concatenate([a, b]) for a, b in ((rows.t, second.t), (rows.q, second.q), (rows.tau, second.tau))]
    episode = ["0"] * len(rows) + ["1"] * len(second)
    names = [f"observation.{what}.{name}" for what in ("state", "effort") for name in ARM.names]
    write_table(path, ",".join(["episode_index", "timestamp", *names]), [episode, both[0], *both[1].T, *both[2].T])
    columns_file(
        path,
        "header: true\ntime: {name: timestamp}\nposition: {first: 3}\neffort: {first: 8}\n"
        f"joints: [{', '.join(ARM.names)}]\n",
    )


def read(*facts, file="free_1.csv", samples=1200):
    """Read by name, all rows, with true results."""
    return (
        info(Answer(says=(count(samples), *facts)), file=file),
        init(done(CELL, exits=(0,))),
        explain(done(REPORT, exits=(0,))),
        replay(Answer(events=(0,)), file=file),
    )


def read_or_refused(*facts, never=()):
    """Read with true results, or refused with these facts."""
    return (
        info(Answer(says=(count(1200),), never=never), refused(*facts, never=never), file="free_1.csv"),
        init(done(CELL, exits=(0,), never=never), refused(*facts, never=never)),
        explain(done(REPORT, exits=(0,), never=never), refused(*facts, never=never)),
        replay(Answer(events=(0,), never=never), refused(*facts, never=never), file="free_1.csv"),
    )


def trial(name, write, runs):
    return Trial(name, tables(write), runs, free="free_{}.csv")


SECONDS_WRONG = (r"11[ ,']?990(\.0+)? s", r"0\.1 Hz")
DEGREES = near(r"\bdegrees?\b", "position")
AGAIN = near(
    r"\btime|\bstamp",
    r"\bback|earlier|decreas|begins? again|restart|fall|repeat|revers",
    r"1[ ,']?20[0-3]\b|\b(12|11\.99?)\b|episode",
)

TRIALS = [
    trial("csv-quoted", quoted("rad", 1.0), read()),
    trial(
        "csv-quoted-degrees",
        quoted("deg", 180 / np.pi),
        (
            info(Answer(says=(DEGREES,)), refused(DEGREES), file="free_1.csv"),
            init(done(CELL, DEGREES), refused(DEGREES)),
            explain(done(REPORT, DEGREES), refused(DEGREES)),
        ),
    ),
    # If it is refused, then with the right line: the first of the numbers is in line 2.
    trial("csv-decimal-comma", decimal_commas, read_or_refused("comma", r"(\.csv:|line )2\b")),
    trial("csv-own-layout", layout("stamp_ns", stamps_ns), read(r"\bj_base\b")),
    trial(
        "csv-milliseconds",
        layout("time", lambda _, rows: 1000 * rows.t, form="{:.5f}"),
        read_or_refused(near(r"\btime\b", r"millisecond|\bms\b|0\.1 Hz"), never=SECONDS_WRONG),
    ),
    trial(
        "csv-iso-dates",
        layout("time", iso),
        read_or_refused(near(r"\btime\b", r"date|ISO|2025-10-09", r"(\.csv:|line )2\b")),
    ),
    trial(
        "report-plotjuggler-date-time",
        date_and_time,
        read_or_refused("Time", r"date|time of day|clock|:53:2", r"(\.csv:|line )2\b"),
    ),
    trial(
        "report-lerobot-episodes",
        episodes,
        (
            info(Answer((0, 3), (AGAIN,)), refused(AGAIN), file="free_1.csv"),
            init(done(CELL, AGAIN), refused(AGAIN)),
            explain(done(REPORT, AGAIN), refused(AGAIN)),
            replay(Answer((0, 3), (AGAIN,), events=(0,)), refused(AGAIN), file="free_1.csv"),
        ),
    ),
]
