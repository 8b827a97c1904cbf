"""Slips in a recording or in what is said of it: what does `explain` say of each, and what of the same arm without a slip?

    python slips.py TAUSCOPE OUT [--seed 1] [--count 4] [--only swapped,degrees] [--given ROBOT UNIT RECORDING...]

Simulates arms with friction on every joint, bodies a little off their URDF and noise that is partly slow, in turn with six and seven joints;
makes each slip in a copy of the recordings; explains the copy; prints a table. --given takes recordings of a real arm in place of the
simulated ones; the last one is held out.
"""
import argparse
import json
import os
import subprocess
import sys

import numpy as np
import yaml

import make
import record
from robot import Robot


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out")
    a.add_argument("--seed", type=int, default=1)
    a.add_argument("--count", type=int, default=4)
    a.add_argument("--only", help="only these slips, separated by commas")
    a.add_argument("--given", nargs="+", metavar=("ROBOT", "UNIT"), help="URDF, Nm or A, and recordings")
    return a.parse_args()


class Arm:
    """The recordings of one arm, joints in the order of its URDF, efforts in N m where torque constants are known."""

    def __init__(self, name, urdf, unit, constants, recordings, held):
        self.name, self.urdf, self.robot = name, os.path.abspath(urdf), Robot(urdf)
        self.unit, self.constants, self.recordings, self.held = unit, constants, recordings, held

    def stationary(self):
        """Sizes of the joints' efforts, to slip where it shows: the standard deviation of each."""
        return np.concatenate([effort for _, _, _, effort in self.recordings.values()]).std(0)


def ordered(path, names):
    """Columns of a recording in the order of the URDF."""
    own, stamps, q, v, tau = record.read(path)
    order = [own.index(name) for name in names]
    return stamps, q[:, order], None if v is None else v[:, order], tau[:, order]


def simulated(o):
    """The arms of a seed."""
    base = os.path.join(o.out, "base")
    urdfs = [os.path.join(make.HERE, "robots", name + ".urdf") for name in ("six", "seven")]
    for k in range(o.count):
        folder = f"{base}_{o.seed + k}"
        if not os.path.exists(os.path.join(folder, "answers.json")):
            subprocess.run([sys.executable, os.path.join(make.HERE, "make.py"), "--out", folder, "--seed", str(o.seed + k), "--count", "1", "--kind",
                            "null", "--beside", "friction,bodies", "--robots", urdfs[k % 2], "--recordings", "3,1", "--seconds", "7,8.5",
                            "--noise-correlation", "0.02,0.3", "--white-share", "0.5"], check=True, stdout=subprocess.DEVNULL)
        with open(os.path.join(folder, "cases", "c00", "case.yaml")) as file:
            case = yaml.safe_load(file)
        urdf = os.path.join(folder, "cases", "c00", case["robot"])
        robot = Robot(urdf)
        constants = np.array([case.get("torque_constants_nm_per_a", {}).get(name, 1.) for name in robot.names])
        recordings, held = {}, [x[:-5] for x in case["holdout"]]
        for file in case["fit"] + case["holdout"]:
            stamps, q, v, tau = ordered(os.path.join(folder, "cases", "c00", file), robot.names)
            if v is None:                                    # slips in the velocity need one
                v = np.gradient(q, stamps * 1e-9, axis=0)
            recordings[file[:-5]] = stamps, q, v, tau * constants
        yield Arm(f"{robot.n} joints, seed {o.seed + k}", urdf, "Nm", np.ones(robot.n), recordings, held)


def given(o):
    """The arm that was given."""
    urdf, unit, *paths = o.given
    names = Robot(urdf).names
    recordings = {os.path.basename(p)[:-5]: ordered(p, names) for p in paths}
    yield Arm(os.path.basename(urdf)[:-5], urdf, unit, None, recordings, list(recordings)[-1:])


def near(arm):
    """The two joints whose efforts are most alike in size, of those that do something."""
    size = arm.stationary()
    pairs = [(abs(np.log(size[a] / size[b])), a, b) for a in range(len(size)) for b in range(a)]
    return sorted(min(pairs)[1:])


def both(arm):
    """The two joints with the largest efforts."""
    return sorted(np.argsort(arm.stationary())[-2:].tolist())


def swap(tau, a, b):
    out = tau.copy()
    out[:, [a, b]] = tau[:, [b, a]]
    return out


def times(x, j, factor):
    out = x.copy()
    out[:, j] *= factor
    return out


# Each takes an arm and gives what the recordings become, the unit and the torque constants that are said, and the words that name the slip.
def slips(arm, rng):
    n, names = arm.robot.n, arm.robot.names
    a, b = near(arm)
    c, d = both(arm)
    j = int(np.argsort(arm.stationary())[n // 2])           # neither the strongest joint nor the weakest
    same = lambda q, v, tau: (q, v, tau)
    constants = arm.robot.effort / rng.uniform(4., 12., n)
    deg, turns = np.where(arm.robot.slides, 1., 180. / np.pi), lambda x: times(x, j, -1.)
    yield "nothing", same, arm.unit, None, ()
    yield f"efforts of {names[a]} and {names[b]} swapped (alike)", lambda q, v, t: (q, v, swap(t, a, b)), arm.unit, None, ("swapped", names[a], names[b])
    yield f"efforts of {names[c]} and {names[d]} swapped (strong)", lambda q, v, t: (q, v, swap(t, c, d)), arm.unit, None, ("swapped", names[c], names[d])
    yield f"effort of {names[j]} turned", lambda q, v, t: (q, v, turns(t)), arm.unit, None, ("other sign", names[j])
    yield f"{names[j]} counts the other way", lambda q, v, t: (turns(q), turns(v), turns(t)), arm.unit, None, ("other way", names[j])
    yield "degrees", lambda q, v, t: (q * deg, v * deg, t), arm.unit, None, ("degrees",)
    yield f"velocity of {names[j]} halved", lambda q, v, t: (q, times(v, j, 0.5), t), arm.unit, None, ("velocity", names[j])
    yield "velocity halved", lambda q, v, t: (q, 0.5 * v, t), arm.unit, None, ("velocity",)
    if arm.unit == "Nm":
        yield "N m said to be A", same, "A", None, ("N m",)
        yield "A said to be N m", lambda q, v, t: (q, v, t / constants), "Nm", None, ("A",)
        yield "constants five times too small", lambda q, v, t: (q, v, t / constants), "A", constants / 5., ("constants",)
        yield "one constant twice too large", lambda q, v, t: (q, v, t / constants), "A", times(constants[None], j, 2.)[0], ("torque_gain", names[j])
        yield "A with the right constants", lambda q, v, t: (q, v, t / constants), "A", constants, ()
        yield "A without constants", lambda q, v, t: (q, v, t / constants), "A", None, ()


def explained(o, arm, folder, change, unit, constants):
    """The report on changed recordings."""
    os.makedirs(folder, exist_ok=True)
    for name, (stamps, q, v, tau) in arm.recordings.items():
        record.write(os.path.join(folder, name + ".mcap"), arm.robot.names, stamps, *change(q, v, tau))
    fit = [name + ".mcap" for name in arm.recordings if name not in arm.held]
    case = {"case": os.path.basename(folder), "robot": arm.urdf, "effort_unit": unit, "topics": {"state": "/joint_states"}, "fit": fit,
            "holdout": [name + ".mcap" for name in arm.held]}
    if constants is not None:
        case["torque_constants_nm_per_a"] = dict(zip(arm.robot.names, constants.tolist()))
    with open(os.path.join(folder, "case.yaml"), "w") as file:
        yaml.safe_dump(case, file, sort_keys=False)
    out = os.path.join(folder, "report")
    subprocess.run([o.tauscope, "explain", os.path.join(folder, "case.yaml"), "--force", "--out", out], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    with open(os.path.join(out, "report.json")) as file:
        return json.load(file)


def told(report):
    """The sentences on slips, and why there is no verdict, if so."""
    faults = [f["sentence"] for f in report["findings"] if f["parameters"].get("kind") in FAULTS]
    return " ".join([*([report["reason"]] if report.get("reason") else []), *faults])


def is_right(report, words):
    """Whether the report finds a slip, or none where there is none. A wrong constant of one joint is a gain of its effort."""
    if report["verdict"] == "not_evaluated":
        return False
    if words[:1] == ("torque_gain",):
        return any((f["effect"], f["joint"]) == words for f in report["findings"]) and not told(report)
    return all(word in told(report) for word in words) if words else not told(report)


# Kinds of `unknown` that are no physics, but a fault of the recording or of what is said of it.
FAULTS = {"efforts_swapped", "names_swapped", "effort_constant", "effort_sign", "effort_without_sign", "position_sign", "joint_sign", "degrees", "gravity_subtracted", "effort_unit", "torque_constant", "velocity_scale"}


def main():
    o = options()
    right, alarms, count = 0, 0, 0
    print("| arm | slip | verdict | said | right |\n| --- | --- | --- | --- | --- |", flush=True)
    for k, arm in enumerate(given(o) if o.given else simulated(o)):
        for i, (slip, change, unit, constants, words) in enumerate(slips(arm, np.random.default_rng([o.seed, k]))):
            if o.only and not any(x in slip for x in o.only.split(",")):
                continue
            report = explained(o, arm, os.path.join(o.out, f"arm{k}", f"slip{i:02d}"), change, unit, constants)
            said = told(report)
            good = is_right(report, words)
            right, alarms, count = right + good, alarms + (bool(said) and not words), count + 1
            other = [f"{f['effect']} {f.get('joint') or f.get('link') or ''} {100 * f['explains']:.0f} %" for f in report["findings"][:3]]
            # The first sentence says what is wrong; the others give evidence and remedy.
            brief = said.split(". ")[0] if said else "; ".join(other)
            print(f"| {arm.name} | {slip} | {report['verdict']} | {brief} | {'yes' if good else 'no'} |", flush=True)
    print(f"\nOf {count} explanations, {right} are right. False alarms on recordings without a slip: {alarms}.")


if __name__ == "__main__":
    main()
