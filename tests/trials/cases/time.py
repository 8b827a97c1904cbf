"""Stamps that are not the time."""

import numpy as np

from lib.motion import Rows
from lib.session import session
from lib.trial import CELL, REPORT, Answer, Trial, done, explain, info, init, near, refused, replay
from lib.writers import messages

BACK = r"\bback|earlier|revers|decreas|loop|repeat|restart|begins? again|fall|behind|rewind"
STAMP = r"\bstamps?\b|\bclock"


def stamp_fact(*facts):
    return near(STAMP, *facts, within=120)


FIVE_A_STAMP = r"\b(5|five)\b[^.]{0,40}(messages|samples|rows|stamp)|coarse|50 ms|0\.05\d* s"
# Times that no recording has.
NEVER = (r"-\d{6,}(\.\d+)? s\b", r"gap of \d{6,}", r"invalid type")


def stamps(function):
    """Each recording's messages with `function(begin, true time)` [ns] as stamp; the log time is right."""

    def each(_, rows, begin_ns):
        return messages(rows, begin_ns, stamp=lambda i, true_ns: function(begin_ns, true_ns))

    return each


def passes(number, first_ns):
    """The recording `number` times; the stamps fall back each time, the log time goes on."""

    def each(_, rows, begin_ns):
        period_ns = round(rows.t[-1] * 1e9) + 10_000_000
        out = []
        for k in range(number):
            out += messages(
                rows,
                begin_ns,
                stamp=lambda i, true_ns: true_ns - begin_ns + first_ns,
                log=lambda i, true_ns, past_ns=k * period_ns: true_ns + past_ns,
            )
        return out

    return each


def overlap(_, rows, begin_ns):
    """After 8 s the stamps fall back by 5 s, and those 5 s are seen again, then the rest."""
    index = np.concatenate([np.arange(800), np.arange(300, len(rows))])
    again = Rows(rows.t[index], rows.q[index], rows.qd[index], rows.tau[index])
    return messages(again, begin_ns, log=lambda i, true_ns: begin_ns + i * 10_000_000)


def coarse(step_ns, which=range(5)):
    def each(recording, rows, begin_ns):
        step = step_ns if recording in which else 1
        return messages(rows, begin_ns, stamp=lambda i, true_ns: true_ns // step * step)

    return each


def usable(*facts, exits=(0, 3), never=NEVER, replayed=True, refusable=True):
    """Every command states the facts; each goes on with true results, or refuses what it cannot use."""
    refusals = (refused(*facts, never=never),) if refusable else ()
    runs = (
        info(Answer(exits, facts, never)),
        init(done(CELL, *facts, exits=exits, never=never), *refusals),
        explain(done(REPORT, *facts, exits=exits, never=never), *refusals),
    )
    return (*runs, replay(Answer(exits, facts, never, events=(0,)), *refusals)) if replayed else runs


def milliseconds(begin_ns, true_ns):
    """A counter of milliseconds, written into the seconds."""
    return (54_321_000 + (true_ns - begin_ns) // 1_000_000) * 10**9


TRIALS = [
    Trial("stamp-zero", session(stamps(lambda begin, true: 0)), usable(stamp_fact(r"\b(0|zero)\b|never (set|filled)"))),
    Trial(
        "stamp-constant",
        session(stamps(lambda begin, true: begin)),
        usable(stamp_fact(r"constant|same|stands? still|one (value|stamp)|does not (change|advance)|never|all equal")),
    ),
    Trial(
        "stamp-milliseconds",
        session(stamps(milliseconds)),
        usable(stamp_fact(r"1[ ,']?000\b|millisecond|\bms\b|log time|logged|arriv|0\.1\d* Hz")),
    ),
    Trial(
        "loop-three",
        session(passes(3, first_ns=0)),
        usable(stamp_fact(BACK, r"\b(12|11\.9\d*|12\.0\d*)\b|twice|\b(2|two) (times|places)"), exits=(0, 3)),
    ),
    # No loop: a simulation whose time begins at 0. Nothing is wrong with it.
    Trial(
        "stamp-from-zero",
        session(stamps(lambda begin, true: true - begin)),
        usable(exits=(0,), refusable=False),
    ),
    Trial(
        "loop-overlap",
        session(overlap),
        usable(stamp_fact(BACK, r"\b(8|7\.9\d*|8\.0\d*|5|5\.0\d*|4\.9\d*|499|500)\b")),
    ),
    # Stamps before 1970, otherwise right.
    Trial(
        "stamp-negative",
        session(stamps(lambda begin, true: true - begin - 1_142_771_387 * 10**9)),
        usable(stamp_fact(r"negative|before|1933|1970|-1[ ,']?142"), never=("invalid type",), refusable=False),
    ),
    Trial(
        "coarse-50ms",
        session(coarse(50_000_000)),
        usable(stamp_fact(r"\b(5|five)\b", r"coarse|share|same|resolution|whole|50 ms|0\.05|each|per")),
    ),
    # Nothing can be learnt by the stamps alone: a second holds two reversals.
    Trial(
        "coarse-second",
        session(coarse(10**9)),
        usable(stamp_fact(r"\b(100|1(\.0+)? s|seconds?)\b", r"coarse|share|same|resolution|whole|each|per")),
    ),
    Trial(
        "coarse-100ms",
        session(coarse(100_000_000)),
        usable(stamp_fact(r"\b(10|ten)\b", r"coarse|share|same|resolution|whole|100 ms|0\.1|each|per")),
    ),
    # Four recordings are sound. Those commands that read the third say so.
    Trial(
        "coarse-one-of-five",
        session(coarse(50_000_000, which=(2,))),
        (
            info(Answer(never=("coarse",))),
            init(
                done(CELL, near("free_3", STAMP, FIVE_A_STAMP), never=NEVER),
                refused(near("free_3", STAMP, FIVE_A_STAMP)),
            ),
            explain(
                done(REPORT, near("free_3", STAMP, FIVE_A_STAMP), never=NEVER),
                refused(near("free_3", STAMP, FIVE_A_STAMP)),
            ),
            replay(Answer((0, 3), (stamp_fact(FIVE_A_STAMP),), events=(0,)), file="free_3.mcap"),
        ),
    ),
]
