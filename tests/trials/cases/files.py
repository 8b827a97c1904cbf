"""Public reports about files, doubled messages and wrapped positions."""

import numpy as np

from lib.arm import ARM, urdf
from lib.motion import Rows
from lib.session import rows_of, session, write_robot
from lib.trial import CELL, REPORT, RECORDINGS, Answer, Run, Trial, count, explain, info, init, near, refused, replay, told
from lib.writers import Message, messages, metadata, start_of, write_mcap


def names_doubled(_, rows, begin_ns):
    """From the middle on, every joint is named twice, with the same values."""
    half = len(rows) // 2
    first = Rows(rows.t[:half], rows.q[:half], rows.qd[:half], rows.tau[:half])
    twice = Rows(rows.t[half:], *(np.tile(field[half:], 2) for field in (rows.q, rows.qd, rows.tau)))
    return messages(first, begin_ns) + messages(twice, begin_ns, ARM.names * 2)


def bridge(recording, rows, begin_ns):
    """Each message up to three times, late and out of order, as two bridges on one router deliver them."""
    draw = np.random.default_rng(recording)
    out = []
    for message in messages(rows, begin_ns):
        for _ in range(draw.integers(1, 4)):
            out.append(Message(message.log_ns + int(draw.uniform(0, 60e6)), message.data))
    return out


def wrapped(_, rows, begin_ns):
    """Positions in [-pi, pi)."""
    return messages(rows.changed(q=(rows.q + np.pi) % (2 * np.pi) - np.pi), begin_ns)


def reindexed(folder):
    """A folder whose metadata.yaml has an empty storage identifier."""
    write_robot(folder)
    for recording in range(RECORDINGS):
        bag = folder / f"free_{recording + 1}"
        bag.mkdir(exist_ok=True)
        held = messages(rows_of(recording), start_of(recording))
        write_mcap(bag / "free_0.mcap", held)
        (bag / "metadata.yaml").write_text(metadata("free_0.mcap", held, storage='""'))


def corrupt(folder):
    """The middle chunk of each file has 64 bytes of zeros."""
    write_robot(folder)
    for recording in range(RECORDINGS):
        path = folder / f"free_{recording + 1}.mcap"
        write_mcap(path, messages(rows_of(recording), start_of(recording)), chunk_size=16 * 1024)
        data = bytearray(path.read_bytes())
        middle = len(data) // 2
        data[middle : middle + 64] = bytes(64)
        path.write_bytes(data)


DAMAGED = near(r"damag|corrupt|decompress|crc|checksum|cannot be read|torn|chunk", r"\d")
TWICE = near(count(600), r"twice|two times|doubl|duplicat|repeat|more than once")
REPEATED = near(r"repeat|duplicat|twice|same (stamp|message)|already|again|second copy|copies", r"\d{3,4}")

TRIALS = [
    Trial(
        "report-ros2-control-names-doubled",
        session(names_doubled),
        (
            info(Answer((0, 3), (TWICE,))),
            init(told(CELL, TWICE), refused(TWICE)),
            explain(told(REPORT, TWICE), refused(TWICE)),
            replay(Answer((0, 3), (r"twice|doubl|duplicat|more than once",), events=(0,))),
        ),
    ),
    Trial(
        "report-kortex-wrap",
        session(wrapped, urdf(joint_type="continuous"), centre=(3.0, -0.5, 0.6, 0.3, 3.0)),
        (
            info(Answer(says=(count(1200),))),
            init(told(CELL, exits=(0,))),
            explain(told(REPORT, exits=(0,))),
            Run(
                "replay free_1.mcap --pipeline cell/pipeline.yaml --out results",
                (Answer(events=(0,), never=("dropped +[1-9]",)),),
            ),
        ),
    ),
    Trial(
        "report-rosbag2-storage-empty",
        reindexed,
        (
            info(Answer(says=(count(1200), "j_base")), file="free_1"),
            init(told(CELL, exits=(0,))),
            explain(told(REPORT, exits=(0,))),
            replay(Answer(events=(0,)), file="free_1"),
        ),
        free="free_{}",
    ),
    Trial(
        "report-mcap-corrupt-chunk",
        corrupt,
        (
            info(Answer((0, 3), (DAMAGED,))),
            init(told(CELL, DAMAGED, exits=(3,))),
            explain(told(REPORT, DAMAGED, exits=(3,))),
            replay(Answer((3,), (DAMAGED,), events=(0,))),
        ),
    ),
    Trial(
        "report-zenoh-bridge-copies",
        session(bridge),
        (
            info(Answer((0, 3), (REPEATED,))),
            init(told(CELL, REPEATED)),
            explain(told(REPORT, REPEATED)),
            replay(Answer((0, 3), (REPEATED,), events=(0,))),
        ),
    ),
]
