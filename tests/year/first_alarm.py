#!/usr/bin/env python3
"""When an arm that changes first raises a false alarm, and what the watch says of the change and when.

    python3 tests/year/first_alarm.py [--tauscope PROGRAM] [--out DIR]

`tauscope init` sets the bundled arm up, simulated with friction and noise as in nights.py. Then the arm changes by more
and more: the friction of one joint rises, all joints become warmer, a mass is put on the tool. Nothing touches the arm.

- *From one day to the next*: at each size the detector looks at three recordings of 40 s of the usual motions. Printed
  is how many contacts it reports. condition/tests/year.rs holds against this what the nights tell of slow changes.
- *At once*: in three recordings of 120 s, one of each motion, the change comes after 60 s. Printed are the seconds from
  the change to the detector's first alarm, and to the first sentence of a watch beside it, with what that says.
"""

import argparse
import json
import os
import subprocess
import tempfile

from nights import PAYLOAD, ROOT, frictions, scenario

# What changes, by how much. Friction in shares of itself, warmth in kelvins, a mass in kg.
CHANGES = {
    "nothing": [1, 2, 3],
    "friction of joint3": [0.05, 0.1, 0.15, 0.2, 0.3, 0.4],
    "friction of joint5": [0.05, 0.1, 0.15, 0.2, 0.25, 0.4],
    "warmth": [3, 6, 10, 14],
    "payload": [0.02, 0.05, 0.1, 0.5, 1.2],
}
AT_ONCE = {"friction of joint3": [0.25, 0.5, 1.0], "friction of joint5": [0.25, 0.5, 1.0], "payload": [0.1, 0.3, 1.2]}
JOINTS = {"friction of joint3": 2, "friction of joint5": 4}
CHANGE_S, LENGTH_S = 60, 120


def run(*words):
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr}")
    return done.stdout


def record(program, folder, seed, text, seconds):
    """Simulates the scenario's recordings; their paths."""
    os.makedirs(folder)
    path = os.path.join(folder, "arm.scenario.yaml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace("duration_s: 16", f"duration_s: {seconds}").replace("name: r", f"name: s{seed}r"))
    out = os.path.join(folder, "out")
    run(program, "simulate", path, "--out", out)
    return [os.path.join(out, name) for name in sorted(os.listdir(out)) if name.endswith(".mcap")]


def lasting(what, size, seed):
    """The scenario of an arm that is so from the start."""
    joint = JOINTS.get(what)
    physics = frictions(size if what == "warmth" else 0.0, joint, size if joint is not None else 0.0)
    return scenario(seed, physics, size if what == "payload" else 0.0)


def sudden(what, size, seed, motion):
    """The scenario of an arm that becomes so after a minute, with one of the motions."""
    head, recordings = scenario(seed, frictions(0.0)).split("recordings:\n")
    text = f"{head}recordings:\n{recordings.splitlines()[motion]}\n"
    if what == "payload":
        change = PAYLOAD.replace("{", f"{{t_start_s: {CHANGE_S}, t_end_s: {LENGTH_S}, ", 1) % size
        added = f"  - {{effect: payload_pickup, parameters: {change}}}\n"
    else:
        joint = JOINTS[what]
        before = frictions(0.0)[joint][0]
        line = f"  - {{effect: coulomb_friction, joint: joint{joint + 1}, parameters: {{coulomb_nm: {before:.6f}}}}}\n"
        assert line in text
        text = text.replace(line, "")
        numbers = f"coulomb_before_nm: {before}, coulomb_after_nm: {before * (1 + size)}, change_time_session_s: {CHANGE_S}"
        added = f"  - {{effect: friction_step, joint: joint{joint + 1}, parameters: {{{numbers}}}}}\n"
    return text.replace("sensors:", added + "sensors:", 1)


def events(program, pipeline, recordings):
    """By recording: the events of the detector, and those of the watch."""
    for one in json.loads(run(program, "replay", *recordings, "--pipeline", pipeline, "--json")):
        alarms = [e for d in one["detectors"] for e in d["events"] if d["stage"] == "detect"]
        told = [e for d in one["detectors"] for e in d["events"] if d["stage"] == "watch"]
        yield alarms, told


def said(event):
    """What a watch names, where and how large."""
    return f"{event['kind']} {event['link'] or event['joints'][0]} {event['size']:.2g}"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--tauscope", default=f"{ROOT}/target/release/tauscope")
    arguments.add_argument("--out", default=None)
    asked = arguments.parse_args()
    program = os.path.abspath(asked.tauscope)
    with tempfile.TemporaryDirectory() as temporary:
        work = asked.out or temporary
        usual = []
        for seed in (1, 2):
            text = scenario(77_000 + seed, frictions(0.0))
            usual += record(program, os.path.join(work, f"usual{seed}"), seed, text, 40)
        cell = os.path.join(work, "cell")
        run(program, "init", *usual, "--robot", f"{ROOT}/tests/data/demo_arm.urdf", "--out", cell)
        # With the detector and the watch that init writes.
        pipeline = os.path.join(cell, "pipeline.yaml")
        print("| from one day to the next | contacts in 2 min, by size |\n| --- | --- |", flush=True)
        for what, sizes in CHANGES.items():
            counts = []
            for at, size in enumerate(sizes):
                seed = 78_000 + 100 * at + len(what)
                folder = os.path.join(work, f"{what.replace(' ', '_')}{at}")
                recordings = record(program, folder, seed, lasting(what, size, seed), 40)
                counts.append(f"{size:g}: {sum(len(alarms) for alarms, _ in events(program, pipeline, recordings))}")
            print(f"| {what} | {', '.join(counts)} |", flush=True)
        print("\n| at once | size | first alarm after [s] | the watch speaks after [s] | it says |\n| --- " + "| --- " * 4 + "|")
        for what, sizes in AT_ONCE.items():
            for at, size in enumerate(sizes):
                seed = 79_000 + 100 * at + len(what)
                folder = os.path.join(work, f"sudden_{what.replace(' ', '_')}{at}")
                first, spoken, words = [], [], []
                for motion in range(3):
                    text = sudden(what, size, seed + motion, motion)
                    recordings = record(program, f"{folder}_{motion}", seed + motion, text, LENGTH_S)
                    alarms, told = next(events(program, pipeline, recordings))
                    if any(e["t"] < CHANGE_S for e in alarms + told):
                        words.append("something before the change")
                    alarms, told = ([e for e in some if e["t"] >= CHANGE_S] for some in (alarms, told))
                    first.append(f"{alarms[0]['t'] - CHANGE_S:.1f}" if alarms else "none")
                    spoken.append(f"{told[0]['t'] - CHANGE_S:.1f}" if told else "none")
                    words += [said(e) for e in told] or ["nothing"]
                print(f"| {what} | {size:g} | {', '.join(first)} | {', '.join(spoken)} | {', '.join(words)} |", flush=True)


if __name__ == "__main__":
    main()
