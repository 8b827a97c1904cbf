"""Recordings as files: MCAP and SQLite bags of sensor_msgs/msg/JointState, and CSV tables."""

import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer

from lib.arm import ARM

TOPIC = "/joint_states"
TYPE = "sensor_msgs/msg/JointState"
# 2025-10-09, a minute between the recordings of a session.
START_NS, BETWEEN_NS = 1_760_000_000_000_000_000, 60_000_000_000
# A message is logged this long after its stamp.
LOG_DELAY_NS = 1_500_000
SCHEMA = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@dataclass(frozen=True)
class Message:
    log_ns: int
    data: bytes


def joint_state(stamp_ns, names, position, velocity, effort):
    """A JointState in little-endian CDR."""
    out = bytearray()

    def put(form, *values):
        size = struct.calcsize("<" + form[-1])
        out.extend(bytes(-len(out) % size) + struct.pack("<" + form, *values))

    def text(value):
        put("I", len(value.encode()) + 1)
        out.extend(value.encode() + b"\0")

    put("i", stamp_ns // 10**9)
    put("I", stamp_ns % 10**9)
    text("")
    put("I", len(names))
    for name in names:
        text(name)
    for values in (position, velocity, effort):
        put("I", len(values))
        if len(values):
            put(f"{len(values)}d", *values)
    return b"\0\1\0\0" + bytes(out)


def joint_state_ros1(number, stamp_ns, names, position, velocity, effort):
    """A JointState in the serialisation of ROS 1."""

    def text(value):
        return struct.pack("<I", len(value.encode())) + value.encode()

    out = struct.pack("<III", number, stamp_ns // 10**9, stamp_ns % 10**9) + text("")
    out += struct.pack("<I", len(names)) + b"".join(text(name) for name in names)
    for values in (position, velocity, effort):
        out += struct.pack(f"<I{len(values)}d", len(values), *values)
    return out


def start_of(recording):
    """Begin of recording 0, 1, ... of a session [ns]."""
    return START_NS + recording * BETWEEN_NS


def messages(rows, start_ns, names=None, stamp=None, log=None, fields="pve"):
    """A message for each row. `stamp` and `log` map (index, true time [ns]) to what is written [ns].

    `fields` has the letters of the fields that are filled: position, velocity, effort.
    """
    names = ARM.names if names is None else names
    out = []
    for i in range(len(rows)):
        true_ns = start_ns + round(rows.t[i] * 1e9)
        stamp_ns = true_ns if stamp is None else int(stamp(i, true_ns))
        log_ns = true_ns + LOG_DELAY_NS if log is None else int(log(i, true_ns))
        values = [column[i] if letter in fields else () for letter, column in zip("pve", (rows.q, rows.qd, rows.tau))]
        out.append(Message(log_ns, joint_state(stamp_ns, names, *values)))
    return out


def write_mcap(path, topics, chunk_size=64 * 1024, encoding="cdr", schema=(TYPE, "ros2msg", SCHEMA), profile="ros2"):
    """`topics`: topic -> messages, or the messages of the usual topic. They are written in the order of arrival."""
    if not isinstance(topics, dict):
        topics = {TOPIC: topics}
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        writer.start(profile=profile, library="trials")
        number = writer.register_schema(schema[0], schema[1], schema[2].encode())
        queue = []
        for topic, held in topics.items():
            channel = writer.register_channel(topic, encoding, number)
            queue += [(message, channel) for message in held]
        queue.sort(key=lambda entry: entry[0].log_ns)
        for number, (message, channel) in enumerate(queue):
            writer.add_message(channel, message.log_ns, message.data, message.log_ns, number)
        writer.finish()


def write_db3(path, held, topic=TOPIC, compress=None):
    path = Path(path)
    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)")
        base.execute("INSERT INTO schema VALUES(3, 'humble')")
        base.execute(
            "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL)"
        )
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
        )
        base.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
            " timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
        )
        base.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        base.execute("INSERT INTO topics VALUES(1, ?, ?, 'cdr', '')", (topic, TYPE))
        packed = [(m.log_ns, compress(m.data) if compress else m.data) for m in held]
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", packed)
    base.close()


def metadata(file, held, storage, topic=TOPIC, compression=("", "")):
    """The `metadata.yaml` of a rosbag2 folder with one file."""
    begin, end = held[0].log_ns, held[-1].log_ns
    return f"""rosbag2_bagfile_information:
  version: 5
  storage_identifier: {storage}
  duration:
    nanoseconds: {end - begin}
  starting_time:
    nanoseconds_since_epoch: {begin}
  message_count: {len(held)}
  topics_with_message_count:
    - topic_metadata:
        name: {topic}
        type: {TYPE}
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: {len(held)}
  compression_format: "{compression[0]}"
  compression_mode: "{compression[1]}"
  relative_file_paths:
    - {file}
  files:
    - path: {file}
      starting_time:
        nanoseconds_since_epoch: {begin}
      duration:
        nanoseconds: {end - begin}
      message_count: {len(held)}
"""


def write_table(path, header, columns, delimiter=",", decimal=".", newline="\n", form="{:.6f}"):
    """A CSV table; a column is an array of numbers or a list of texts. `header` None: no header line."""
    lines = [] if header is None else [header]
    for row in zip(*columns):
        cells = (cell if isinstance(cell, str) else form.format(cell).replace(".", decimal) for cell in row)
        lines.append(delimiter.join(cells))
    Path(path).write_text(newline.join(lines) + newline, encoding="utf-8", newline="")
