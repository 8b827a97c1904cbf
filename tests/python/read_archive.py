"""Reads every message of an MCAP with the reference reader and prints what it found, as JSON.

    read_archive.py ARCHIVE

Per topic: schema name, number of messages, first and last header stamp [ns], and per joint the sum
of the efforts. Uses mcap and mcap-ros2-support from PyPI, nothing of tauscope.
"""
import json
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def main(path):
    topics = {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = topics.setdefault(channel.topic, {
                "type": schema.name, "encoding": schema.encoding, "count": 0, "effort_sum": {},
            })
            topic["count"] += 1
            if hasattr(decoded, "header"):
                stamp = decoded.header.stamp.sec * 1_000_000_000 + decoded.header.stamp.nanosec
                topic.setdefault("first_stamp_ns", stamp)
                topic["last_stamp_ns"] = stamp
            if schema.name == "sensor_msgs/msg/JointState":
                for name, effort in zip(decoded.name, decoded.effort):
                    topic["effort_sum"][name] = topic["effort_sum"].get(name, 0.0) + effort
    json.dump({"profile": header.profile, "metadata": metadata, "topics": topics}, sys.stdout)


main(sys.argv[1])
