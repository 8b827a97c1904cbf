"""Writes bags of ROS 1: none.bag, bz2.bag, lz4.bag, beside this file or in the folder named.

They hold the joint states and flags of `write` in ../common/mod.rs, and a text with every fifth. The later half is
written first, in chunks of 2 kB.

    pip install rosbags==0.11.9 && python ros1_bags.py [FOLDER [COUNT]]
"""

import sys
from math import nan
from pathlib import Path

from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 10_000_000
COUNT = int(sys.argv[2]) if len(sys.argv) > 2 else 50
FOLDER = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent

store = get_typestore(Stores.ROS1_NOETIC)
types = store.types
array = __import__("numpy").array


def header(i: int):
    """The header of the `i`-th message."""
    seconds, nanoseconds = divmod(START_NS + i * PERIOD_NS, 1_000_000_000)
    stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return types["std_msgs/msg/Header"](seq=i, stamp=stamp, frame_id="base")


def state(i: int):
    """The `i`-th joint state."""
    return types["sensor_msgs/msg/JointState"](
        header=header(i),
        name=["a", "b"],
        position=array([float(i), -float(i)]),
        velocity=array([]),
        effort=array([0.5 * i, nan]),
    )


for compression in ["none", "bz2", "lz4"]:
    path = FOLDER / f"{compression}.bag"
    path.unlink(missing_ok=True)
    writer = Writer(path)
    writer.chunk_threshold = 2000
    if compression != "none":
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer:

        def topic(name: str, kind: str):
            """A topic of this name, and how a message is written to it."""
            connection = writer.add_connection(name, kind, typestore=store)
            return lambda ns, message: writer.write(connection, ns, store.serialize_ros1(message, kind))

        states = topic("/joint_states", "sensor_msgs/msg/JointState")
        contacts = topic("/contact", "std_msgs/msg/Bool")
        texts = topic("/other", "std_msgs/msg/String")
        half = COUNT // 2
        for i in [*range(half, COUNT), *range(half)]:
            ns = START_NS + i * PERIOD_NS
            states(ns + 5, state(i))
            if i % 10 == 0:
                contacts(ns + 6, types["std_msgs/msg/Bool"](data=i % 20 == 0))
            if i % 5 == 0:
                texts(ns + 7, types["std_msgs/msg/String"](data=f"text {i}"))
