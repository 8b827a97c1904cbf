"""Gives a set of cyclic.py a twin as a robot's controller has one: its effort is that of the commanded motion, not of the motion that the arm makes,
and it knows friction to within a tenth or two. Behind it an arm that swings back onto its path after a hit has a residual, though nothing touches it.

    reference_twin.py TAUSCOPE SCENARIO.yaml SET OUT

SET is the folder that `tauscope simulate SCENARIO.yaml --out SET` made. OUT gets its recordings with /twin/joint_states beside, its labels and
its set.yaml.
"""
import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml


def friction(physics, rng):
    """What the twin knows of it: plain laws, and their parameters not quite."""
    for effect in physics:
        known = effect["parameters"]
        if effect["effect"] == "stribeck_friction":
            coulomb_nm = known["coulomb_nm"] * float(rng.uniform(0.85, 1.15))
            yield {"effect": "coulomb_friction", "joint": effect["joint"], "parameters": {"coulomb_nm": coulomb_nm}}
        if effect["effect"] == "temperature_viscous":
            viscous = known["viscous_warm_nms_per_rad"] * float(rng.uniform(0.9, 1.15))
            yield {"effect": "viscous_friction", "joint": effect["joint"], "parameters": {"viscous_nms_per_rad": viscous}}


def main():
    tauscope, scenario, path, out = sys.argv[1], yaml.safe_load(Path(sys.argv[2]).read_text()), Path(sys.argv[3]).resolve(), Path(sys.argv[4])
    spec = yaml.safe_load((path / "set.yaml").read_text())
    out.mkdir(parents=True, exist_ok=True)
    robot, unit, constants = path / spec["robot"], spec["effort_unit"], spec["torque_constants_nm_per_a"]
    name = robot.read_text().split('robot name="')[1].split('"')[0]
    twin = {"version": 1, "robot": {"name": name, "urdf_sha256": hashlib.sha256(robot.read_bytes()).hexdigest()}, "effort_unit": unit,
            "filters": {"velocity_cutoff_hz": 12.0, "effort_cutoff_hz": 15.0},
            "joints": {joint: {"gain": 1.0, "offset": 0.0} for joint in constants},
            "terms": list(friction(scenario["physics"], np.random.default_rng(scenario["seed"] + 10**6)))}
    (out / "controller.yaml").write_text(yaml.safe_dump(twin))
    recordings = [path / recording for role in ("train", "validation", "test") for recording in spec[role]]
    topics = {"state": spec["topics"]["state"], "command": spec["topics"]["command"]}
    pipeline = {"version": 1, "cells": {"cell": {"robot": str(robot), "effort_unit": unit, "torque_constants_nm_per_a": constants}}, "stages": [
        {"name": "ingest", "ingest": {"file": {"path": str(recordings[0]), "topics": topics}, "rate": "fast"}},
        {"name": "twin", "input": "ingest", "twin": {"motion": "commanded", "model": "controller.yaml"}},
        {"name": "record", "inputs": ["ingest", "twin"], "record": {"mcap": "replayed.mcap"}}]}
    (out / "pipeline.yaml").write_text(yaml.safe_dump(pipeline))
    command = [tauscope, "replay", *recordings, "--pipeline", out / "pipeline.yaml", "--out", out, "--force"]
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    spec["topics"]["twin"] = "/twin/joint_states"
    for file in (spec["labels"], spec["robot"]):
        shutil.copy(path / file, out / file)
    (out / "set.yaml").write_text(yaml.safe_dump(spec))


if __name__ == "__main__":
    main()
