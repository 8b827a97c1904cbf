"""Draws a scenario of collaborative assembly for `tauscope simulate`: an arm under impedance control whose tool runs into boxes and whom
operators lead, as examples/scenarios/assembly.yaml, but with random boxes, forces, links and operators, and many recordings.

    assembly.py ROBOT.urdf SEED TRAIN TEST > scenario.yaml

The robot is Panda-like: links panda_link1 to 7 and `tool`, joints panda_joint1 to 7. One operator in the TRAIN recordings, four in the TEST
recordings; one validation recording in between, in which nothing is touched.
"""
import json
import sys

import numpy as np

POSTURE = [0.06, -0.1, 0.1, -1.9, 0.0, 1.85, 0.95]
TIP_M = [0, 0, 0.15]
LINKS = [f"panda_link{i}" for i in range(2, 8)]
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
LINK_SHARES = np.array([1, 2, 3, 3, 3, 4]) / 16


def floats(values):
    return [float(value) for value in values]


def box(rng, start, above, hole):
    """Under the tool's way down (most often), or beside its way there; or none."""
    kind = rng.choice(["top", "side", "none"], p=[0.75, 0.2, 0.05])
    if kind == "top":
        center = hole + [rng.uniform(-0.02, 0.02), rng.uniform(-0.02, 0.02), rng.uniform(0.015, 0.09) - 0.1]
        size, turn, start_s = [rng.uniform(0.14, 0.3), rng.uniform(0.14, 0.3), 0.2], [*rng.uniform(-0.25, 0.25, 2), rng.uniform(-1, 1)], 0.0
    elif kind == "side":
        center = (start + above) / 2 - [0, 0, 0.02]
        if np.linalg.norm((start - center)[:2]) < 0.12:
            return []
        size, turn, start_s = [*rng.uniform(0.05, 0.1, 2), 0.3], [0, 0, rng.uniform(-1.5, 1.5)], rng.uniform(2, 4)
    else:
        return []
    shape = {"center_m": floats(center), "size_m": floats(size), "rpy_rad": floats(turn)}
    return [{"box": shape, "from_s": float(start_s), "point_m": TIP_M, "radius_m": 0.008,
             "stiffness_n_per_m": float(np.exp(rng.uniform(np.log(5e3), np.log(3e4)))), "damping_ns_per_m": float(rng.uniform(20, 90))}]


def cooperations(rng, operators, duration_s):
    contacts, t = [], rng.uniform(0.8, 3)
    for _ in range(rng.integers(1, 4)):
        operator = operators[rng.integers(len(operators))]
        direction = rng.normal(size=3)
        if rng.uniform() < 0.4:
            direction[2] = abs(direction[2]) + 0.5  # out of the way of what lies below
        force, lasts_s = rng.uniform(*operator["force_n"]), rng.uniform(0.65, 1.8)
        if t + lasts_s > duration_s - 0.3:
            break
        contacts.append({
            "link": str(rng.choice(LINKS, p=LINK_SHARES)), "force_n": floats(force * direction / np.linalg.norm(direction)),
            "t_on_s": float(t), "t_off_s": float(t + lasts_s), "rise_s": float(operator["rise_s"] * rng.uniform(0.7, 1.4)),
            "profile": str(rng.choice(["smooth", "trapezoid"])), "kind": "cooperation", "label": operator["label"]})
        t += lasts_s + rng.uniform(0.8, 4)
    return contacts


def recording(rng, name, role, operators):
    hole = np.array([rng.uniform(0.45, 0.58), rng.uniform(-0.12, 0.12), rng.uniform(0.14, 0.2)])
    above = hole + [0, 0, rng.uniform(0.1, 0.2)]
    start = hole + [rng.uniform(-0.15, 0.1), rng.uniform(-0.2, 0.2), rng.uniform(0.1, 0.25)]
    aside = hole + [rng.uniform(-0.15, 0.1), rng.uniform(-0.15, 0.15), rng.uniform(0.1, 0.25)]
    duration_s = float(rng.uniform(11, 17))
    points = {"through_m": [floats(point) for point in (start, above, hole, above, aside)], "reach": {"point_m": TIP_M, "posture": POSTURE},
              "speed": float(rng.uniform(0.05, 0.16)), "acceleration_rad_s2": float(rng.uniform(1.5, 4)), "rest_s": [0.1, 0.5]}
    touched = role != "validation"
    return {"name": name, "role": role, "duration_s": duration_s, "motion": {"points": points},
            "obstacles": box(rng, start, above, hole) if touched else [], "contacts": cooperations(rng, operators, duration_s) if touched else []}


def physics(rng):
    effects = [{"effect": "link_mass", "link": link, "parameters": {"delta_mass_kg": float(rng.uniform(-0.04, 0.04))}} for link in LINKS]
    for joint, most in zip(JOINTS, [0.2] * 4 + [0.06] * 3):
        effects.append({"effect": "coulomb_friction", "joint": joint, "parameters": {"coulomb_nm": float(rng.uniform(0.3, 1) * most)}})
    for joint in JOINTS[:4]:
        effects.append({"effect": "viscous_friction", "joint": joint, "parameters": {"viscous_nms_per_rad": float(rng.uniform(0.1, 0.6))}})
    return effects


def main():
    robot, seed, train, test = sys.argv[1], *map(int, sys.argv[2:5])
    rng = np.random.default_rng(seed)
    operators = [{"label": {"operator": f"op{i}", "experienced": i < 2}, "rise_s": rng.uniform(0.05, 0.22),
                  "force_n": (rng.uniform(9, 14), rng.uniform(22, 36))} for i in range(4)]
    roles = ["train"] * train + ["validation"] + ["test"] * test
    scenario = {
        "version": 1, "name": "assembly", "robot": robot, "seed": seed, "rate_hz": 1000,
        "controller": {"impedance": {"point_m": TIP_M}}, "physics": physics(rng),
        "sensors": {"position_step_rad": 3e-5, "velocity_noise_rad_s": 0.001, "effort_noise_nm": 0.04,
                    "effort_bias_nm": {joint: float(rng.uniform(-0.2, 0.2)) for joint in JOINTS[:4]}},
        "recordings": [recording(rng, f"rec_{i:03d}", role, operators[:1] if role == "train" else operators) for i, role in enumerate(roles)]}
    json.dump(scenario, sys.stdout, indent=1)  # which YAML is a superset of


if __name__ == "__main__":
    main()
