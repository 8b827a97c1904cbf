"""Draws a scenario of hands on random paths for `tauscope simulate`, as examples/scenarios/paths.yaml: an arm with about as much unknown
physics as an explained twin leaves, pushed anywhere along and around four links.

    paths.py ROBOT.urdf SEED TRAIN VALIDATION TEST [FREE] > scenario.yaml

FREE more test recordings, in which nothing touches the arm, count false alarms. The robot is xArm7-like: links link1 to link7, joints joint1 to joint7.
"""
import json
import sys
import xml.etree.ElementTree as ET

import numpy as np

LINKS = ["link3", "link4", "link5", "link6"]
JOINTS = [f"joint{i}" for i in range(1, 8)]
LARGER = [1.5, 1.5, 1.2, 1.2, 0.8, 0.8, 0.5]  # joints near the base rub more
MOTION = {"points": {"within": {"radius_m": 0.2, "turn_rad": 0.6}, "reach": {"posture": [0.2, -0.4, 0, 1.2, -0.4, 0.7, 0.3]},
                     "min_height_m": 0.13, "speed": 0.2, "acceleration_rad_s2": 4, "rest_s": [0, 0.1]}}


def xyz(element):
    return np.array([float(x) for x in element.get("xyz").split()])


def unit(rng):
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)


def pushes(rng, ends, centres, duration_s):
    contacts, t = [], rng.uniform(1, 2.5)
    while t < duration_s - 1.8:
        link, lasts_s = str(rng.choice(LINKS)), rng.uniform(0.3, 1.1)
        along = np.linalg.norm(ends[link]) > 0.02 and rng.uniform() < 0.5
        point = (ends[link] * rng.uniform() if along else centres[link]) + unit(rng) * rng.uniform(0.03, 0.06)
        force = np.exp(rng.uniform(np.log(7), np.log(45))) * unit(rng)
        contacts.append({"link": link, "point_m": [float(x) for x in point], "force_n": [float(x) for x in force], "t_on_s": float(t),
                         "t_off_s": float(t + lasts_s), "rise_s": float(min(rng.uniform(0.04, 0.15), lasts_s / 2))})
        t += lasts_s + rng.uniform(1.5, 3)
    return contacts


def friction(rng, joint, larger):
    return [{"effect": "coulomb_friction", "joint": joint, "parameters": {"coulomb_nm": float(rng.uniform(0.05, 0.2) * larger)}},
            {"effect": "viscous_friction", "joint": joint, "parameters": {"viscous_nms_per_rad": float(rng.uniform(0.05, 0.3) * larger)}}]


def main():
    robot, seed, *counts = sys.argv[1], *map(int, sys.argv[2:6])
    free = int(sys.argv[6]) if len(sys.argv) > 6 else 0
    rng, urdf = np.random.default_rng(seed), ET.parse(robot).getroot()
    centres = {link.get("name"): xyz(link.find("inertial/origin")) for link in urdf.findall("link") if link.find("inertial") is not None}
    ends = {joint.find("parent").get("link"): xyz(joint.find("origin")) for joint in urdf.findall("joint")}
    physics = [effect for joint, larger in zip(JOINTS, LARGER) for effect in friction(rng, joint, larger)]
    physics += [{"effect": "link_mass", "link": link, "parameters": {"delta_mass_kg": float(rng.uniform(-0.02, 0.02))}} for link in LINKS]
    roles, recordings = [role for role, count in zip(["train", "validation", "test"], counts) for _ in range(count)], []
    for i, role in enumerate(roles):
        duration_s = float(rng.uniform(22, 34))
        contacts = pushes(rng, ends, centres, duration_s) if role == "test" else []
        recordings.append({"name": f"rec_{i:03d}", "role": role, "duration_s": duration_s, "motion": MOTION, "contacts": contacts})
    rng = np.random.default_rng(seed + 10**6)
    recordings += [{"name": f"rec_{len(roles) + i:03d}", "role": "test", "duration_s": float(rng.uniform(22, 34)), "motion": MOTION, "contacts": []}
                   for i in range(free)]
    scenario = {"version": 1, "name": "paths", "robot": robot, "seed": seed, "rate_hz": 100, "physics": physics,
                "sensors": {"position_step_rad": 3e-5, "velocity_noise_rad_s": 0.001, "effort_noise_nm": 0.15}, "recordings": recordings}
    json.dump(scenario, sys.stdout, indent=1)  # which YAML is a superset of


if __name__ == "__main__":
    main()
