#!/usr/bin/env python3
"""A detector outside the pipeline: hears the residual, and publishes a verdict of its own.

    pip install eclipse-zenoh
    python3 detector.py --cell demo --connect tcp/127.0.0.1:7447 --band 3.0

A contact begins where a joint's residual leaves the band [N m], and ends once all have been back for 0.1 s. For each
residual that comes, the verdict goes to `<cell>/python/detection`, as JSON of the same shape as
`<cell>/detections/<detector>` (docs/publish.md). Not a safety function.
"""

import argparse
import json
import time

import zenoh

HOLD_NS = 100_000_000


class Band:
    """A pure state machine: time comes from the samples."""

    def __init__(self, band):
        self.band = band
        self.begun_ns = None
        self.outside_ns = None

    def judge(self, residual):
        """The verdict on a residual message."""
        stamp_ns = residual["stamp_ns"]
        score = max(abs(effort) for effort in residual["effort"])
        event = None
        if score > self.band:
            self.outside_ns = stamp_ns
            if self.begun_ns is None:
                self.begun_ns, event = stamp_ns, "onset"
        elif self.begun_ns is not None and not 0 <= stamp_ns - self.outside_ns < HOLD_NS:
            self.begun_ns, event = None, "offset"
        alarm = self.begun_ns is not None
        joints = [name for name, effort in zip(residual["name"], residual["effort"]) if abs(effort) > self.band]
        verdict = {
            "stamp_ns": stamp_ns,
            "sequence": residual["sequence"],
            "detector": "python_band",
            "state": "contact" if alarm else "free",
            "ready": True,
            "alarm": alarm,
            "score": score,
            "threshold": self.band,
            "joints": joints,
        }
        if event:
            verdict["event"] = event
        if alarm:
            verdict["contact_ns"] = self.begun_ns
        return verdict


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell", default="demo")
    parser.add_argument("--connect", action="append", default=[], help="endpoint, e.g. tcp/127.0.0.1:7447")
    parser.add_argument("--listen", action="append", default=[], help="endpoint to listen on")
    parser.add_argument("--band", type=float, default=3.0, help="N m")
    arguments = parser.parse_args()
    config = zenoh.Config()
    config.insert_json5("mode", '"router"' if arguments.listen else '"peer"')
    config.insert_json5("connect/endpoints", json.dumps(arguments.connect))
    config.insert_json5("listen/endpoints", json.dumps(arguments.listen))
    config.insert_json5("scouting/multicast/enabled", "false")
    detector = Band(arguments.band)
    with zenoh.open(config) as session:
        publisher = session.declare_publisher(f"{arguments.cell}/python/detection", encoding="application/json")

        def judge(sample):
            verdict = detector.judge(json.loads(sample.payload.to_bytes()))
            publisher.put(json.dumps(verdict))
            if "event" in verdict:
                print(verdict["stamp_ns"], verdict["event"], *verdict["joints"], flush=True)

        subscriber = session.declare_subscriber(f"{arguments.cell}/residual", judge)
        try:
            while True:
                time.sleep(1)
        except KeyboardInterrupt:
            subscriber.undeclare()


if __name__ == "__main__":
    main()
