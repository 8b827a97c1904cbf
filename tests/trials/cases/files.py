"""Bags, encodings, doubled messages and wrapped positions."""

import json

import numpy as np
import zstandard

from lib.arm import ARM, urdf
from lib.motion import Rows
from lib.session import rows_of, session, write_robot
from lib.trial import (
    CELL,
    RECORDINGS,
    REPORT,
    Answer,
    Run,
    Trial,
    count,
    counts,
    done,
    explain,
    info,
    init,
    near,
    refused,
    replay,
)
from lib.writers import TYPE, Message, joint_state_ros1, messages, metadata, start_of, write_db3, write_mcap


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


def compressed(folder):
    """SQLite bags whose messages are compressed with zstd."""
    write_robot(folder)
    pack = zstandard.ZstdCompressor().compress
    for recording in range(RECORDINGS):
        bag = folder / f"free_{recording + 1}"
        bag.mkdir(exist_ok=True)
        held = messages(rows_of(recording), start_of(recording))
        write_db3(bag / "free_0.db3", held, compress=pack)
        text = metadata("free_0.db3", held, "sqlite3", compression=("zstd", "MESSAGE"))
        (bag / "metadata.yaml").write_text(text)


def empty_metadata(folder):
    """SQLite bags whose recorder died before it wrote metadata.yaml: the file is empty."""
    write_robot(folder)
    for recording in range(RECORDINGS):
        bag = folder / f"free_{recording + 1}"
        bag.mkdir(exist_ok=True)
        write_db3(bag / "free_0.db3", messages(rows_of(recording), start_of(recording)))
        (bag / "metadata.yaml").write_text("")


def whole_file_zstd(folder):
    """MCAP files that were compressed as a whole."""
    session()(folder)
    for path in folder.glob("free_*.mcap"):
        path.with_suffix(".mcap.zstd").write_bytes(zstandard.ZstdCompressor().compress(path.read_bytes()))
        path.unlink()


def other_encoding(encoding, schema, profile, encode):
    """MCAP files whose messages are not CDR."""

    def make(folder):
        write_robot(folder)
        for recording in range(RECORDINGS):
            rows, begin_ns = rows_of(recording), start_of(recording)
            held = []
            for i in range(len(rows)):
                stamp_ns = begin_ns + round(rows.t[i] * 1e9)
                data = encode(i, stamp_ns, ARM.names, rows.q[i], rows.qd[i], rows.tau[i])
                held.append(Message(stamp_ns + 1_500_000, data))
            path = folder / f"free_{recording + 1}.mcap"
            write_mcap(path, held, encoding=encoding, schema=schema, profile=profile)

    return make


ROS1_SCHEMA = """Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""


def joint_state_json(_, stamp_ns, names, position, velocity, effort):
    stamp = {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}
    fields = {"position": list(position), "velocity": list(velocity), "effort": list(effort)}
    return json.dumps({"header": {"stamp": stamp, "frame_id": ""}, "name": names, **fields}).encode()


def read_or_refused(*facts, free, never=()):
    """Read with true results, or refused by every command with these facts."""
    first = free.format(1)
    return (
        info(Answer((0, 2), facts, never), Answer(says=(count(1200), "j_base"), never=never), file=first),
        init(refused(*facts, never=never), done(CELL, exits=(0,), never=never)),
        explain(refused(*facts, never=never), done(REPORT, exits=(0,), never=never)),
        replay(Answer((2, 3), facts, never), Answer(events=(0,), never=never), file=first),
    )


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


DAMAGED = r"damag|corrupt|decompress|crc|checksum|cannot be read|chunk"
# A chunk has 64 messages.
LOST_CHUNK = rf"{counts(64)}|\b0\.6[345]\d* s"
TWICE = near(counts(600), r"twice|two times|doubl|duplicat|repeat|more than once")
REPEATED = near(r"repeat|duplicat|twice|same (stamp|message)|already|again|second copy|copies", r"\d{3,4}")

ZSTD = r"zstd|compress"
ABSENT = ("holds no sensor_msgs", "not of that type")

TRIALS = [
    Trial("bag-message-zstd", compressed, read_or_refused(ZSTD, free="free_{}", never=ABSENT), free="free_{}"),
    Trial(
        "bag-file-zstd",
        whole_file_zstd,
        read_or_refused(ZSTD, r"zstd -d|unzstd|decompress", free="free_{}.mcap.zstd"),
        free="free_{}.mcap.zstd",
    ),
    Trial(
        "bag-empty-metadata",
        empty_metadata,
        (
            info(Answer((0, 3), (count(1200), "j_base", r"metadata\.yaml")), file="free_1"),
            init(done(CELL, r"metadata\.yaml")),
            explain(done(REPORT, r"metadata\.yaml")),
            replay(Answer((0, 3), events=(0,)), file="free_1"),
        ),
        free="free_{}",
    ),
    Trial(
        "mcap-ros1",
        other_encoding("ros1", ("sensor_msgs/JointState", "ros1msg", ROS1_SCHEMA), "ros1", joint_state_ros1),
        read_or_refused(r"ros ?1", free="free_{}.mcap", never=ABSENT),
    ),
    Trial(
        "mcap-json",
        other_encoding("json", (TYPE, "jsonschema", '{"type": "object"}'), "", joint_state_json),
        read_or_refused("json", free="free_{}.mcap", never=ABSENT),
    ),
    Trial(
        "report-ros2-control-names-doubled",
        session(names_doubled),
        (
            info(Answer((0, 3), (TWICE,))),
            init(done(CELL, TWICE), refused(TWICE)),
            explain(done(REPORT, TWICE), refused(TWICE)),
            replay(Answer((0, 3), (r"twice|doubl|duplicat|more than once",), events=(0,))),
        ),
    ),
    Trial(
        "report-kortex-wrap",
        session(wrapped, urdf(joint_type="continuous"), centre=(3.0, -0.5, 0.6, 0.3, 3.0)),
        (
            info(Answer(says=(count(1200),))),
            init(done(CELL, exits=(0,))),
            explain(done(REPORT, exits=(0,))),
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
            init(done(CELL, exits=(0,))),
            explain(done(REPORT, exits=(0,))),
            replay(Answer(events=(0,)), file="free_1"),
        ),
        free="free_{}",
    ),
    Trial(
        "report-mcap-corrupt-chunk",
        corrupt,
        (
            info(Answer((0, 3), (DAMAGED, LOST_CHUNK))),
            init(done(CELL, DAMAGED, LOST_CHUNK, exits=(3,))),
            explain(done(REPORT, DAMAGED, LOST_CHUNK, exits=(3,))),
            replay(Answer((3,), (DAMAGED, LOST_CHUNK), events=(0,))),
        ),
    ),
    Trial(
        "report-zenoh-bridge-copies",
        session(bridge),
        (
            info(Answer((0, 3), (REPEATED,))),
            init(done(CELL, REPEATED)),
            explain(done(REPORT, REPEATED)),
            replay(Answer((0, 3), (REPEATED,), events=(0,))),
        ),
    ),
]
