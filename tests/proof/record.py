"""MCAP recordings of sensor_msgs/msg/JointState in the profile `ros2`, with a small CDR encoder."""
import struct

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

DEFINITION = """std_msgs/Header header
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


def align(body, to):
    body.extend(b"\0" * (-len(body) % to))


def encode(ns, names, arrays):
    """CDR bytes of one message; an absent field is an empty sequence."""
    body = bytearray(struct.pack("<iI", ns // 10**9, ns % 10**9))
    body += struct.pack("<I", 1) + b"\0"
    align(body, 4)
    body += struct.pack("<I", len(names))
    for name in names:
        align(body, 4)
        text = name.encode() + b"\0"
        body += struct.pack("<I", len(text)) + text
    for x in arrays:
        align(body, 4)
        body += struct.pack("<I", 0 if x is None else len(x))
        if x is not None and len(x):
            align(body, 8)
            body += np.ascontiguousarray(x, "<f8").tobytes()
    return b"\0\1\0\0" + bytes(body)


def write(path, names, stamps_ns, position, velocity, effort, command=None, twin=None):
    """One recording: /joint_states, and if given `command`, /joint_commands (positions), and `twin`, /twin/joint_states (efforts).  Rows are samples."""
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=4 << 20, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="concealed-arm")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", DEFINITION.encode())
        states = writer.register_channel("/joint_states", "cdr", schema)
        commands = None if command is None else writer.register_channel("/joint_commands", "cdr", schema)
        twins = None if twin is None else writer.register_channel("/twin/joint_states", "cdr", schema)
        for i, ns in enumerate(int(x) for x in stamps_ns):
            row = (position[i], None if velocity is None else velocity[i], effort[i])
            writer.add_message(states, ns, encode(ns, names, row), ns, i)
            if twins is not None:
                writer.add_message(twins, ns, encode(ns, names, (None, None, twin[i])), ns, i)
            if commands is not None:
                writer.add_message(commands, ns, encode(ns, names, (command[i], None, None)), ns, i)
        writer.finish()


def decode(body):
    """(names, position, velocity, effort) of one message, as `encode` wrote it; an absent field is empty."""
    at = 8                                                   # behind the stamp

    def count():
        nonlocal at
        at += -at % 4
        (n,) = struct.unpack_from("<I", body, 4 + at)
        at += 4
        return n

    def text():
        nonlocal at
        n = count()
        at += n
        return bytes(body[4 + at - n:4 + at - 1]).decode()

    def numbers():
        nonlocal at
        n = count()
        at += -at % 8 if n else 0
        x = np.frombuffer(body, "<f8", n, 4 + at)
        at += 8 * n
        return x

    text()
    names = [text() for _ in range(count())]
    return names, numbers(), numbers(), numbers()


def read(path, topic="/joint_states"):
    """(names, stamps [ns], position, velocity, effort) of a topic of sensor_msgs/msg/JointState. Rows are samples; what is
    absent is None."""
    with open(path, "rb") as file:
        rows = [(m.log_time, *decode(m.data)) for _, _, m in make_reader(file).iter_messages(topics=[topic])]
    stack = lambda k: np.stack([row[k] for row in rows])
    given = [column if column.shape[1] else None for column in map(stack, (2, 3, 4))]
    return rows[0][1], stack(0).astype(np.int64), *given
