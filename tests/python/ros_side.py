"""A ROS 2 side without ROS: hears what tauscope publishes, as rmw_zenoh would, and says what it heard.

    ros_side.py ENDPOINT DOMAIN NAMESPACE

Listens at ENDPOINT, prints `ready`, and prints one line of JSON once the run that it hears has ended.
Packages: eclipse-zenoh, rosbags.
"""

import json
import sys
import threading

import zenoh
from rosbags.typesys import Stores, get_typestore

LONGEST_S = 120


def main(endpoint, domain, namespace):
    types = get_typestore(Stores.ROS2_JAZZY)
    heard = {"contact": [], "onsets": [], "holes": 0, "topics": {}, "undecodable": []}
    numbers = {}
    ended = threading.Event()

    def on_ros(sample):
        _, _, *topic, dds_type, _ = str(sample.key_expr).split("/")
        topic, ros_type = "/".join(topic), dds_type.replace("::dds_::", "/").replace("::", "/").rstrip("_")
        try:
            message = types.deserialize_cdr(sample.payload.to_bytes(), ros_type)
        except Exception as error:
            heard["undecodable"].append(f"{topic}: {error}")
            return
        heard["topics"][topic] = ros_type
        attachment = sample.attachment.to_bytes()
        number = int.from_bytes(attachment[:8], "little", signed=True)
        heard["holes"] += number - numbers.get(topic, number - 1) - 1
        numbers[topic] = number
        if topic == "contact":
            before = heard["contact"][-1] if heard["contact"] else None
            if message.data != before:
                heard["contact"].append(bool(message.data))
        if topic == "detections":
            values = {pair.key: pair.value for pair in message.status[0].values}
            if values["event"] == "onset":
                stamp = message.header.stamp
                heard["onsets"].append(stamp.sec * 10**9 + stamp.nanosec)

    def on_alarm(sample):
        heard["topics"]["alarm (JSON)"] = "json"
        alarm = json.loads(sample.payload.to_bytes())
        # The run is over when the newest detection is known and nothing is heard any more.
        if alarm["state"] == "silent" and alarm["stamp_ns"] > 0:
            ended.set()

    def settings(mode, **endpoints):
        """Those of a router, or of a node behind it, which is a peer."""
        config = zenoh.Config()
        config.insert_json5("mode", json.dumps(mode))
        for kind in ("listen", "connect"):
            config.insert_json5(f"{kind}/endpoints", json.dumps(endpoints.get(kind, [])))
        config.insert_json5("scouting/multicast/enabled", "false")
        return config

    router = settings("router", listen=[endpoint])
    node = settings("peer", connect=[endpoint], listen=["tcp/127.0.0.1:0"])
    with zenoh.open(router), zenoh.open(node) as session:
        ros = session.declare_subscriber(f"{domain}/{namespace}/**", on_ros)
        alarm = session.declare_subscriber(f"{namespace}/alarm", on_alarm)
        print("ready", flush=True)
        heard["ended"] = ended.wait(LONGEST_S)
        del ros, alarm
    print(json.dumps(heard), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
