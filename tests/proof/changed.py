"""Arms as real ones are, and what changes on them: explained as they are, then with a load, then hit while they move, beside the first twin.

    python changed.py TAUSCOPE OUT [--seed 1] [--count 4] [--robots DIR_OR_FILES ...]

No mass, centre or inertia is quite what the URDF says, friction is stiff and not the same from day to day, noise is partly slow, the clock
uneven.  In turn the effort is a motor current without torque constants, a torque sensor's behind the gear, a motor torque, or one of an arm
whose wrist is coupled.  Prints a table.
"""
import argparse
import glob
import json
import os
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import yaml

import make
import motion
import record
import truth
from plant import Plant
from robot import Robot

KINDS = ["current", "sensor", "motor", "wrist"]
MASS_OFF, CENTRE_OFF_M = 0.06, 0.006          # of what the URDF says; standard deviations
COUPLED = (0.22, -0.13)                       # the last joint by the one before, that by the one before it
RATE, SLOW_NOISE_S, PAUSE_S = 100., 0.05, 20.


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out")
    a.add_argument("--seed", type=int, default=1)
    a.add_argument("--count", type=int, default=4)
    a.add_argument("--robots", nargs="+", default=[os.path.join(make.HERE, "robots", r + ".urdf") for r in ("six", "seven")])
    return a.parse_args()


def as_built(nominal, rng, path):
    """The robot as it was built: every inertial a little off."""
    root = ET.fromstring(nominal.stripped_urdf())
    for inertial in root.iter("inertial"):
        share = 1 + MASS_OFF * rng.normal()
        mass, tensor, origin = inertial.find("mass"), inertial.find("inertia"), inertial.find("origin")
        mass.set("value", repr(float(mass.get("value")) * share))
        for key in tensor.attrib:
            tensor.set(key, repr(float(tensor.get(key)) * share))
        if origin is None:
            origin = ET.SubElement(inertial, "origin")
        xyz = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()]) + CENTRE_OFF_M * rng.normal(size=3)
        origin.set("xyz", " ".join(repr(float(x)) for x in xyz))
    ET.ElementTree(root).write(path)
    return Robot(path)


class Arm:
    """One arm: what it is, and what it records."""

    def __init__(self, kind, urdf, seed, folder):
        self.kind, self.folder, self.rng = kind, folder, np.random.default_rng([seed, KINDS.index(kind)])
        os.makedirs(folder, exist_ok=True)
        self.nominal = Robot(urdf)
        with open(os.path.join(folder, "arm.urdf"), "w") as file:
            file.write(self.nominal.stripped_urdf())
        self.robot = as_built(self.nominal, self.rng, os.path.join(folder, "built.urdf"))
        n, effort = self.robot.n, self.robot.effort
        self.sigma = 1.2e-3 * effort
        self.constant = effort / self.rng.uniform(4., 12., n) if kind == "current" else np.ones(n)
        self.static = 0.03 * effort * self.rng.uniform(0.6, 1.4, n)

    def effects(self, share):
        """What the arm does beyond its bodies; friction is by a share of what it was at first."""
        if self.kind == "sensor":                  # behind the gear there is no friction
            return []
        all_, robot = [], self.robot
        at = lambda name, joint, **parameters: all_.append({"effect": name, "joint": joint, "parameters": parameters})
        for j, joint in enumerate(robot.names):
            at("viscous_friction", joint, viscous_nms_per_rad=float(1.2 * share * self.static[j]))
            at("stribeck_friction", joint, coulomb_nm=float(0.8 * share * self.static[j]), static_nm=float(share * self.static[j]),
               stribeck_velocity_rad_s=0.05)
            at("rotor_inertia", joint, inertia_kgm2=float(robot.effort[j] / 150))
            if j in (1, 2):
                at("load_dependent_friction", joint, coefficient=0.05)
        if self.kind == "wrist":
            for k, coefficient in enumerate(COUPLED, start=1):
                at("transmission_coupling", robot.names[-k], coefficient=coefficient, source_joint=robot.names[-k - 1])
        return all_

    def record(self, tag, kinds, seconds, share, changed=lambda names, commands: []):
        """Records a session; the names of its recordings, and what was changed for it."""
        names = [f"{tag}_{k}" for k in range(len(kinds))]
        commands = [motion.draw(self.nominal, self.rng, kind, seconds) for kind in kinds]
        new = changed(names, commands)
        effects = self.effects(share) + new
        plant = Plant(self.robot, effects, commands)
        for k, (name, command) in enumerate(zip(names, commands)):
            start = k * (seconds + PAUSE_S)
            log = plant.record(name, command, start)
            if log.trouble:
                raise RuntimeError(f"{self.folder} {name}: {log.trouble}")
            self.write(name, start, truth.of_log(name, start, log), truth.recorded(self.robot, effects, log, start), seconds)
        return names, new

    def write(self, name, start, m, clean, seconds):
        rng, n = self.rng, self.robot.n
        t = np.arange(int(seconds * RATE)) / RATE
        t[1:] += rng.uniform(-0.2, 0.2, len(t) - 1) / RATE
        t = t[t < seconds - 0.01]
        at = lambda x: np.stack([np.interp(t, m.t, column) for column in x.T], 1)
        slow, white = make.coloured(rng, t, n, SLOW_NOISE_S), rng.normal(size=(len(t), n))
        q, tau = at(m.q), at(clean) + self.sigma * np.sqrt(0.5) * (slow + white)
        if self.kind == "sensor":                  # strain gauges: a per cent of gain, an offset, a ripple twice a turn
            gauge, effort = np.arange(n), self.robot.effort
            tau = tau * (1 + 0.01 * np.sin(gauge + 1)) + effort * (0.004 * np.cos(3 * gauge) + 0.002 * np.sin(2 * q + 0.3))
        q = np.round((q + make.ENCODER_NOISE * rng.normal(size=q.shape)) / make.ENCODER_STEP) * make.ENCODER_STEP
        v = np.round((at(m.v) + make.SPEED_NOISE * rng.normal(size=q.shape)) * 1024) / 1024
        stamps = np.round((1.76e9 + start + t) * 1e9).astype(np.int64)
        record.write(os.path.join(self.folder, name + ".mcap"), self.robot.names, stamps, q, v, tau / self.constant)

    def explain(self, tauscope, name, fit, holdout, twin=None):
        """The report on a case beside a twin or the URDF."""
        case = {"case": name, "robot": "arm.urdf", "effort_unit": "A" if self.kind == "current" else "Nm", "topics": {"state": "/joint_states"},
                "fit": [x + ".mcap" for x in fit], "holdout": [x + ".mcap" for x in holdout]}
        path = os.path.join(self.folder, name)
        with open(path + ".yaml", "w") as file:
            yaml.safe_dump(case | ({"twin": {"model": f"{twin}/twin.yaml"}} if twin else {}), file, sort_keys=False)
        subprocess.run([tauscope, "explain", path + ".yaml", "--force", "--out", path], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(os.path.join(path, "report.json")) as file:
            return json.load(file)


def push(link, force):
    """Two hits on a link, half a second each, where the arm moves most."""
    def drawn(names, commands):
        q = commands[-1]
        speed = np.abs(np.diff(q, axis=0)).sum(1) * motion.RATE
        half = motion.RATE // 2
        mean = np.convolve(speed, np.ones(half) / half, "valid")
        mean[:2 * motion.RATE] = mean[-2 * motion.RATE:] = 0
        windows = []
        for _ in range(2):
            k = int(mean.argmax())
            mean[max(0, k - 2 * motion.RATE):k + 2 * motion.RATE] = 0
            windows.append({"recording": names[-1], "t_start": k / motion.RATE, "t_end": (k + half) / motion.RATE})
        parameters = dict(zip(("force_x_n", "force_y_n", "force_z_n"), force))
        return [{"effect": "external_push", "link": link, "windows": windows, "parameters": parameters}]
    return drawn


def interval(finding, name):
    """A number with its interval."""
    value = finding["parameters"].get(name)
    low, high = finding["intervals_95"].get(name, [float("nan")] * 2)
    return "-" if value is None else f"{value:.3g} ({low:.3g} to {high:.3g})"


def hits(report, windows):
    """Of each hit: link and force as said, for those said at its time; and the links alone."""
    out, links = [], []
    for w in windows:
        own = [f for f in report["findings"] if f["effect"] == "external_push" and f["recording"] == w["recording"]
               and f["t_start"] < w["t_end"] and f["t_end"] > w["t_start"]]
        force = lambda f: " ".join(f"{f['parameters'].get(f'force_{a}_n', float('nan')):.0f}" for a in "xyz")
        out.append(f"{own[0]['link']} {force(own[0])}" if own else "not found")
        links.append(own[0]["link"] if own else None)
    return "; ".join(out), links


def row(arm, tauscope):
    """What was changed on an arm and what was said of it, as a row of the table; and what counts in the end: whether
    the payload's interval holds its mass, by which share the mass is off, and how many links each hit is off."""
    rng, robot = arm.rng, arm.robot
    free, _ = arm.record("free", ["fourier", "via", "via", "fourier", "via"], 15., 1.)
    report = arm.explain(tauscope, "free", free[:4], free[4:])
    size = lambda key: float(np.sqrt((np.array(report[key])**2).sum()))
    fell = f"{size('holdout_rms_before'):.3g} to {size('holdout_rms_after'):.3g}"
    coupled = [f"{f['joint']} by {f['parameters']['source_joint']} {interval(f, 'coefficient')}" for f in report["findings"]
               if f["effect"] == "transmission_coupling" and f["confidence"] > 0.5]

    mass = round(float(rng.uniform(0.08, 0.2) * robot.effort[1] / 9.81 / 1.2), 2)
    body = {"mass_kg": mass, "com_x_m": 0.02, "com_y_m": -0.01, "com_z_m": 0.06} | {f"i{a}{a}_kgm2": 0.0015 * mass for a in "xyz"}
    load = {"effect": "payload", "link": robot.tool, "parameters": body}
    loaded, _ = arm.record("loaded", ["via", "fourier", "via", "via"], 12., float(rng.uniform(0.9, 1.15)), lambda *_: [load])
    said = arm.explain(tauscope, "loaded", loaded[:3], loaded[3:], "free")["findings"]
    payload = next((f for f in said if f["effect"] == "payload"), None)
    carried = interval(payload, "mass_kg") if payload else "not found"
    low, high = (payload or {"intervals_95": {}})["intervals_95"].get("mass_kg", [np.inf, -np.inf])
    off = abs(payload["parameters"]["mass_kg"] / mass - 1.) if payload else np.inf

    link = robot.moving_links[int(rng.integers(robot.n // 2, robot.n))]
    force = [round(float(x), 1) for x in rng.uniform(8., 30., 3) * rng.choice([-1, 1], 3)]
    hit, new = arm.record("hit", ["via", "via"], 12., 1.02, push(link, force))
    report = arm.explain(tauscope, "hit", hit, free[4:], "free")
    concealed = f"{link} {' '.join(f'{x:.0f}' for x in force)}"
    told, links = hits(report, new[0]["windows"])
    at = robot.moving_links.index
    away = [abs(at(x) - at(link)) if x in robot.moving_links else np.inf for x in links]
    cells = [f"{robot.n} joints, {arm.kind}", fell, ", ".join(coupled), f"{mass} kg", carried, concealed, told]
    return cells, (low <= mass <= high, off, away)


def main():
    o = options()
    paths = [p for x in o.robots for p in (sorted(glob.glob(os.path.join(x, "*.urdf"))) if os.path.isdir(x) else [x])]
    head = ["arm, effort", "error on the hold-out", "couplings said", "payload", "said", "two hits, N", "said"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head), flush=True)
    ends = []
    for k in range(o.count):
        kind = KINDS[k % len(KINDS)]
        seed = o.seed + k // len(KINDS)
        arm = Arm(kind, paths[k % len(paths)], seed, os.path.join(o.out, f"{kind}_{seed}"))
        cells, end = row(arm, o.tauscope)
        ends.append(end)
        print("| " + " | ".join(cells) + " |", flush=True)
    held, off, away = zip(*ends)
    away = np.concatenate(away)
    print(f"\n{sum(held)} of {len(held)} payloads lie within their intervals; the masses are off by {100 * np.median(off):.1f} % in the median. Of "
          f"{len(away)} hits, {np.sum(away == 0)} are told at their link, {np.sum(away == 1)} more at the next one, {np.sum(~np.isfinite(away))} not.")


if __name__ == "__main__":
    main()
