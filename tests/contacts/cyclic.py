"""Draws a scenario of cyclic moves under a stiff joint controller for `tauscope simulate`, as examples/scenarios/cyclic.yaml: the tool
runs into something that is crushed, which is then taken away, and the arm swings back onto its path.

    cyclic.py ROBOT.urdf SEED TEST > scenario.yaml

The robot is UR10-like: joints shoulder_pan_joint to wrist_3_joint, and a link wrist_3_link that carries the tool. One recording to train on,
one for validation, and TEST others; in every fourth of them nothing is touched.
"""
import json
import sys

import numpy as np

JOINTS = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
LINKS = ["upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link"]
TORQUE_CONSTANTS_NM_PER_A = [13.5, 13.5, 11.0, 8.0, 8.0, 8.0]
COULOMB_NM = [12, 15, 9, 3.5, 3, 2.5]
VISCOUS_NMS_PER_RAD = [14, 16, 10, 3, 2.5, 2]
# The tool's tip in the frame of wrist_3_link, and how the arm reaches for a place in front of it, with the tool down.
TIP_M = [0, 0, 0.2122]
POSTURE = [3.14, -1.2, 1.9, -2.27, -1.57, 0]
# How hard it is to crush, how long the force takes to get there, and how long it goes on.
MATERIALS = {"cardboard": ((60, 190), (0.015, 0.06), (0.4, 1.0)), "polystyrene": ((80, 190), (0.01, 0.03), (0.4, 1.2)),
             "foam": ((45, 85), (0.08, 0.25), (0.6, 1.5))}


def cycle(rng):
    """From left to right and from top to bottom, near the base and far out."""
    near_m, far_m, side_m, top_m = rng.uniform(0.45, 0.6), rng.uniform(0.78, 0.9), rng.uniform(0.18, 0.3), rng.uniform(0.36, 0.46)
    low_m = top_m - rng.uniform(0.14, 0.22)
    at = lambda x, y, z: [float(x), float(y), float(z)]
    places = [place for x in (near_m, far_m) for place in (at(x, side_m, top_m), at(x, -side_m, top_m), at(x, -side_m, low_m), at(x, -side_m, top_m))]
    rest_s = float(rng.uniform(0.1, 0.5))
    return {"points": {"through_m": places, "reach": {"link": "wrist_3_link", "point_m": TIP_M, "posture": POSTURE},
                       "speed": float(rng.uniform(0.25, 0.5)), "acceleration_rad_s2": float(rng.uniform(2, 5)), "rest_s": [rest_s, rest_s]}}


def hits(rng, duration_s):
    contacts, t = [], rng.uniform(2, 8)
    while t < duration_s - 7:
        material = str(rng.choice(list(MATERIALS)))
        force_n, rise_s, lasts_s = (rng.uniform(*span) for span in MATERIALS[material])
        direction = rng.normal(scale=0.1, size=3)
        direction[rng.integers(1, 3)] += rng.choice([-1, 1])
        contacts.append({"link": "wrist_3_link", "point_m": TIP_M, "force_n": [float(x) for x in force_n * direction / np.linalg.norm(direction)],
                         "t_on_s": float(t), "t_off_s": float(t + lasts_s), "rise_s": float(rise_s), "profile": "smooth", "kind": "collision",
                         "label": {"material": material}})
        t += lasts_s + rng.uniform(7, 14)
    return contacts


def physics(rng):
    effects = [{"effect": "link_mass", "link": link, "parameters": {"delta_mass_kg": float(rng.uniform(-0.15, 0.15))}} for link in LINKS]
    for joint, coulomb_nm, viscous in zip(JOINTS, COULOMB_NM, VISCOUS_NMS_PER_RAD):
        coulomb_nm, viscous = coulomb_nm * rng.uniform(0.5, 1.3), viscous * rng.uniform(0.5, 1.3)
        of_joint = {
            "stribeck_friction": {"coulomb_nm": coulomb_nm, "static_nm": coulomb_nm * rng.uniform(1, 1.5),
                                  "stribeck_velocity_rad_s": rng.uniform(0.02, 0.1)},
            "temperature_viscous": {"viscous_warm_nms_per_rad": viscous, "viscous_extra_cold_nms_per_rad": viscous * rng.uniform(0, 0.3),
                                    "time_constant_s": 120},
            "torque_ripple": {"amplitude_nm": coulomb_nm * rng.uniform(0, 0.1), "cycles_per_rev": rng.integers(2, 60),
                              "phase_rad": rng.uniform(-3, 3)},
            "torque_gain": {"gain": rng.uniform(0.96, 1.04)}}
        effects += [{"effect": effect, "joint": joint, "parameters": {name: float(value) for name, value in parameters.items()}}
                    for effect, parameters in of_joint.items()]
    return effects


def main():
    robot, seed, test = sys.argv[1], *map(int, sys.argv[2:4])
    rng = np.random.default_rng(seed)
    motion, recordings = cycle(rng), []
    for i, (role, duration_s) in enumerate([("train", 38), ("validation", 19)] + [("test", 0)] * test):
        duration_s = float(duration_s or rng.uniform(19, 38))
        contacts = hits(rng, duration_s) if role == "test" and i % 4 != 1 else []
        recordings.append({"name": f"rec_{i:03d}", "role": role, "duration_s": duration_s, "motion": motion, "contacts": contacts})
    scenario = {
        "version": 1, "name": "cyclic", "robot": robot, "seed": seed, "rate_hz": 500,
        "effort_unit": "A", "torque_constants_nm_per_a": dict(zip(JOINTS, TORQUE_CONSTANTS_NM_PER_A)),
        "controller": {"natural_hz": float(rng.uniform(5, 12)), "damping": float(rng.uniform(0.7, 1.2)),
                       "integral_time_s": float(rng.uniform(0.15, 0.8))},
        "physics": physics(rng),
        "sensors": {"position_step_rad": 2e-5, "velocity_noise_rad_s": 0.001, "effort_noise_nm": 0.6, "effort_step_nm": 0.1,
                    "effort_bias_nm": {joint: float(rng.uniform(-1, 1)) for joint in JOINTS[:3]}},
        "recordings": recordings}
    json.dump(scenario, sys.stdout, indent=1)  # which YAML is a superset of


if __name__ == "__main__":
    main()
