"""Faults that workshops know, each on an arm as real ones are: what is said of it, where, and what a mechanic is told to look at.

    python faults.py TAUSCOPE OUT [--seed 1] [--count 30] [--only brake_drags,belt_loose] [--short]

An arm has friction on every joint, bodies a few per cent off its URDF, and noise that is partly slow. It is explained while it is sound; then a
fault is made, and new recordings are explained beside the twin of the sound arm, as a workshop does. Arms take turns: six and seven joints. The
table has a row for each fault. --short makes three faults on short motions that are followed exactly; it takes a minute.

A fault counts as `named` if the finding with the largest effort has its name and place, as `found` if that finding is an `unknown` at its place,
or another finding names it, and else as `missed`.
"""
import argparse
import html
import json
import os
import re
import subprocess

import numpy as np
import yaml

import draws
import effects
import judge
import make
import motion
import record
import truth
from robot import Robot

RATE, WHITE_SHARE, PAUSE_S = 100., 0.5, 20.
SOUND, FAULTY = (3, 1), (2, 1)                # recordings to fit and held out
SHIFT_SHOWS = 3.                              # in standard deviations of the noise
SURE = 0.5                                    # findings with less confidence are not counted as said
SHORT = ["brake_drags", "encoder_remounted", "connectors_swapped"]


def while_(p, session):
    """1 within the session's windows of an effect."""
    return sum((session >= a) * (session < b) for a, b in p["session_windows"])


# What the simulator has not had yet.
effects.FRICTION["unknown:late_brake"] = lambda p, m, q, v, session, **_: -p["amplitude_nm"] * while_(p, session) * m.tanh(v / effects.SMOOTHING)


class Fault:
    """A fault: the effect that it is, or what it does to a recording; the names that are right; words that a mechanic must be told."""

    def __init__(self, name, effect=None, right=(), words="", changes=None, everywhere=False, size=(15., 45.)):
        self.name, self.effect, self.right, self.words = name, effect, right, words
        self.changes, self.everywhere, self.size = changes, everywhere, size


def zero_offset(q, v, tau, j, rng):
    return shifted(q, j, float(rng.choice([-1, 1]) * rng.uniform(0.015, 0.04))), v, tau


def eccentric_encoder(q, v, tau, j, rng):
    a, phase = rng.uniform(0.008, 0.02), rng.uniform(-3, 3)
    return shifted(q, j, a * np.sin(q[:, j] + phase)), scaled(v, j, 1 + a * np.cos(q[:, j] + phase)), tau


def swapped(q, v, tau, j, rng):
    out, k = tau.copy(), j + 1 if j + 1 < tau.shape[1] else j - 1
    out[:, [j, k]] = tau[:, [k, j]]
    return q, v, out


def renamed(q, v, tau, j, rng):
    k = j + 1 if j + 1 < tau.shape[1] else j - 1
    order = np.arange(tau.shape[1])
    order[[j, k]] = order[[k, j]]
    return q[:, order], v[:, order], tau[:, order]


def dead(q, v, tau, j, rng):
    out = tau.copy()
    out[:, j] = round(float(tau[0, j]), 2)
    return q, v, out


def shifted(x, j, by):
    out = x.copy()
    out[:, j] += by
    return out


def scaled(x, j, by):
    out = x.copy()
    out[:, j] *= by
    return out


BODY = ("payload", "link_mass", "link_com", "payload_pickup")
FAULTS = [
    Fault("belt_loose", "joint_elasticity", ("joint_elasticity", "backlash"), "gear|coupling|screw"),
    Fault("gear_has_play", "backlash", ("backlash", "joint_elasticity"), "gear|coupling|screw"),
    Fault("gear_tooth_worn", "unknown:worn_segment", ("unknown", "eccentric_gear", "torque_ripple"), "gear|look at it"),
    Fault("gear_efficiency_lost", "unknown:gear_efficiency", ("gear_efficiency", "load_dependent_friction"), "gear"),
    Fault("gear_preload_too_high", "load_dependent_friction", ("load_dependent_friction", "load_squared_friction"), "gear"),
    Fault("gear_off_centre", "unknown:eccentric_gear", ("eccentric_gear",), "gear|bearing"),
    Fault("brake_drags", "coulomb_friction", ("coulomb_friction",), "brake"),
    Fault("brake_lets_go_late", "late_brake", ("unknown", "friction_step"), "brake|look at it"),
    Fault("bearing_fails", "friction_step", ("friction_step",), "bearing"),
    Fault("seal_hard_one_way", "asymmetric_coulomb", ("asymmetric_coulomb",), "seal"),
    Fault("grease_dried_out", "stribeck_friction", ("stribeck_friction", "coulomb_friction"), "lubrica|grease"),
    Fault("lubricant_cold", "viscous_friction", ("viscous_friction",), "lubrica|grease|cold", everywhere=True, size=(15., 25.)),
    Fault("joint_heats_up", "unknown:heating_friction", ("unknown", "friction_step", "coulomb_friction"), "bearing|brake|look at it"),
    Fault("oil_overfilled", "quadratic_drag", ("quadratic_drag",), "oil"),
    Fault("encoder_remounted", None, ("joint_zero_offset",), "zero", changes=zero_offset),
    Fault("encoder_off_centre", None, ("unknown", "torque_ripple"), "sensor|encoder|look at it", changes=eccentric_encoder),
    Fault("cable_pulled", "cable_spring", ("cable_spring", "counterbalance_spring"), "cable"),
    Fault("hose_caught_at_the_end", "unknown:end_cushion", ("unknown", "cable_spring", "contact_wall"), "cable|hose|look at it"),
    Fault("gravity_spring_broken", "counterbalance_spring", ("counterbalance_spring", "cable_spring", "torque_ripple"), "spring"),
    Fault("tool_data_wrong", "payload", BODY, "tool|mounted"),
    Fault("cover_missing", "link_mass", BODY, "mounted"),
    Fault("workpiece_not_dropped", "payload_pickup", ("payload_pickup", "payload"), "grip|held|hold"),
    Fault("base_bolts_loose", "base_tilt", ("base_tilt",), "base"),
    Fault("fixture_in_the_way", "contact_wall", ("contact_wall", "external_push"), "run into|surround|contact"),
    Fault("motor_phase_lost", "torque_ripple", ("torque_ripple", "unknown"), "motor"),
    Fault("current_sensor_offset", "torque_bias", ("torque_bias",), "offset"),
    Fault("current_sensor_gain", "torque_gain", ("torque_gain",), "sensor|constant"),
    Fault("drive_limit_lowered", "torque_saturation", ("torque_saturation",), "limit"),
    Fault("effort_filter_on", "torque_lowpass", ("torque_lowpass", "torque_delay"), "smooth|clock|time"),
    Fault("connectors_swapped", None, ("efforts_swapped",), "exchange|connector", changes=swapped),
    Fault("names_swapped_in_driver", None, ("names_swapped",), "name", changes=renamed),
    Fault("torque_sensor_dead", None, ("effort_constant",), "sensor", changes=dead),
    Fault("drive_sign_turned", None, ("effort_sign",), "sign", changes=lambda q, v, tau, j, rng: (q, v, scaled(tau, j, -1.))),
    Fault("joint_counts_backwards", None, ("joint_sign", "position_sign", "effort_sign"), "axis|sign|turn",
          changes=lambda q, v, tau, j, rng: (scaled(q, j, -1.), scaled(v, j, -1.), scaled(tau, j, -1.))),
    Fault("driver_in_degrees", None, ("degrees",), "rad", changes=lambda q, v, tau, j, rng: (np.degrees(q), np.degrees(v), tau), everywhere=True),
]


class Arm:
    """A sound arm, its recordings and its twin."""

    def __init__(self, o, urdf, seed, folder):
        self.o, self.folder, self.rng = o, folder, np.random.default_rng(seed)
        os.makedirs(folder, exist_ok=True)
        self.robot = Robot(urdf)
        self.sigma = 1e-3 * self.robot.effort
        with open(os.path.join(folder, "arm.urdf"), "w") as file:
            file.write(self.robot.stripped_urdf())
        seconds = 5. if o.short else 6.5
        self.seconds = seconds
        while True:                           # a motion that the arm can follow
            names, commands, starts, fit = self.motions("sound", SOUND)
            c = self.context(names, commands, starts, fit)
            o_beside = argparse.Namespace(beside="friction,bodies")
            self.own = make.background(o_beside, c, self.rng)
            if self.record(names, commands, starts, self.own):
                break
        self.explain("sound", fit, [x for x in names if x not in fit], None)

    def motions(self, tag, counts):
        """Names, commands and starts of recordings, and which to fit."""
        kinds = ["fourier", "via", "via", "fourier"][:sum(counts)]
        names = [f"{tag}_{k}" for k in range(len(kinds))]
        commands = [motion.draw(self.robot, self.rng, kind, self.seconds) for kind in kinds]
        return names, commands, [k * (self.seconds + PAUSE_S) for k in range(len(kinds))], names[:counts[0]]

    def context(self, names, commands, starts, fit):
        return draws.Context(self.robot, [truth.of_command(*x) for x in zip(names, starts, commands)], fit, self.sigma)

    def record(self, names, commands, starts, all_effects, change=None):
        """Writes recordings; False if the arm loses track."""
        if self.o.short:
            logs, trouble = make.followed(self.robot, all_effects, names, commands, starts)
        else:
            logs, trouble = make.simulate(self.robot, all_effects, names, commands, starts)
        if trouble:
            return False
        rng, n = self.rng, self.robot.n
        for name, start, log in zip(names, starts, logs):
            m, clean = truth.of_log(name, start, log), truth.recorded(self.robot, all_effects, log, start)
            t = np.arange(int(self.seconds * RATE) - 1) / RATE
            at = lambda x: np.stack([np.interp(t, m.t, column) for column in x.T], 1)
            slow = make.coloured(rng, t, n, 0.1)
            tau = at(clean) + self.sigma * (np.sqrt(1 - WHITE_SHARE) * slow + np.sqrt(WHITE_SHARE) * rng.normal(size=(len(t), n)))
            q = np.round((at(m.q) + make.ENCODER_NOISE * rng.normal(size=tau.shape)) / make.ENCODER_STEP) * make.ENCODER_STEP
            v = np.round((at(m.v) + make.SPEED_NOISE * rng.normal(size=tau.shape)) * 1024) / 1024
            if change:
                q, v, tau = change(q, v, tau)
            stamps = np.round((1.76e9 + start + t) * 1e9).astype(np.int64)
            record.write(os.path.join(self.folder, name + ".mcap"), self.robot.names, stamps, q, v, tau)
        return True

    def explain(self, name, fit, held, twin):
        """The report, and what its page tells a mechanic to look at."""
        path = os.path.join(self.folder, name)
        case = {"case": name, "robot": "arm.urdf", "effort_unit": "Nm", "topics": {"state": "/joint_states"}, "fit": [x + ".mcap" for x in fit],
                "holdout": [x + ".mcap" for x in held]} | ({"twin": {"model": f"{twin}/twin.yaml"}} if twin else {})
        with open(path + ".yaml", "w") as file:
            yaml.safe_dump(case, file, sort_keys=False)
        subprocess.run([self.o.tauscope, "explain", path + ".yaml", "--force", "--out", path], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        with open(os.path.join(path, "report.html")) as file:
            page = file.read()
        told = re.search(r"<dt>Look at</dt><dd>(.*?)</dd>", page, re.S)
        told = re.findall(r"<li>(.*?)<span", told.group(1), re.S) if told else []
        with open(os.path.join(path, "report.json")) as file:
            return json.load(file), [html.unescape(re.sub("<.*?>", "", x)).strip() for x in told]

    def draw(self, fault, c, commands, starts):
        """The effects of a fault and the joint, link or whole arm that it is in; None where this motion does not show it."""
        rng, robot = self.rng, self.robot
        target = float(np.exp(rng.uniform(*np.log(fault.size))))
        if fault.changes or fault.effect == "late_brake":
            loud = [j for j in range(robot.n) if c.swing[j] > 20. * c.sigma[j] and c.range[j] > 0.3]
            if fault.changes in (zero_offset, eccentric_encoder):
                shows = {j: shift_shows(fault, c, j) for j in loud}
                loud = [j for j in loud if shows[j] > SHIFT_SHOWS] or sorted(loud, key=shows.get)[-1:]
            j = int(rng.choice(loud or [1]))
            if fault.changes:
                return [], j
            return [late_brake(robot, j, target * self.sigma[j], commands, starts)], j
        if fault.everywhere:
            all_ = [draws.draw(f"{fault.effect}@{j}", c, rng, target) for j in range(robot.n)]
            return ([e for e in all_ if e] or None), None
        e = draws.draw(fault.effect, c, rng, target)
        if e is None:
            return None, None
        return [e], robot.names.index(e["joint"]) if e.get("joint") in robot.names else None

    def faulty(self, fault):
        """Records and explains a fault: the report, what to look at, the effects, and the joint."""
        for _ in range(12):
            names, commands, starts, fit = self.motions(fault.name, FAULTY)
            c = self.context(names, commands, starts, fit)
            new, joint = self.draw(fault, c, commands, starts)
            if new is None:
                continue
            seed = int(self.rng.integers(2**32))
            change = fault.changes and (lambda q, v, tau: fault.changes(q, v, tau, joint, np.random.default_rng(seed)))
            if self.record(names, commands, starts, self.own + new, change):
                return *self.explain(fault.name, fit, [x for x in names if x not in fit], "sound"), new, joint
        return None


def shift_shows(fault, c, j):
    """By how much a joint that stands elsewhere than recorded changes the efforts, in standard deviations of the noise at the joint that shows most."""
    change = lambda m: fault.changes(m.q, m.v, np.zeros_like(m.q), j, np.random.default_rng(0))[0]
    less = np.concatenate([c.robot.nominal.rnea(change(m), m.v, m.a) - c.rigid[m.recording] for m in c.fit_motions])
    return float(np.max(np.sqrt(np.mean(less**2, 0)) / c.sigma))


def late_brake(robot, j, size, commands, starts):
    """Friction for 0.6 s after each standstill of a joint, the first included."""
    windows = []
    for command, start in zip(commands, starts):
        moves = np.abs(np.gradient(command[:, j], 1 / motion.RATE)) > 0.005
        begins = np.flatnonzero(moves[1:] & ~moves[:-1])
        windows += [(start + k / motion.RATE, start + k / motion.RATE + 0.6) for k in begins]
    return {"effect": "unknown", "joint": robot.names[j], "parameters": {"kind": "late_brake", "amplitude_nm": 2. * float(size), "session_windows": windows}}


def name_of(finding):
    return finding["parameters"].get("kind") or finding["effect"]


def verdict(fault, robot, report, new, joint):
    """(named, found or missed; what was said first; how many more)."""
    where = judge.places(robot)
    said = [f for f in report["findings"] if f["confidence"] >= SURE]
    said.sort(key=lambda f: -f.get("effort_rms", 0.))
    place = lambda f: where.get(f.get("joint") or f.get("link"))
    link = next((where[e["link"]] for e in new if e.get("link") in where), None)

    def here(f):
        if fault.everywhere or name_of(f) in judge.NOWHERE or joint is None and link is None:
            return True
        if name_of(f) in ("efforts_swapped", "names_swapped", "transmission_coupling"):
            return joint in (place(f), where.get(f["parameters"].get("source_joint")))
        if joint is None:
            return f["effect"] == "unknown" or place(f) is None or abs(place(f) - link) <= 1
        return place(f) == joint

    right = lambda f: here(f) and (name_of(f) in fault.right or f["effect"] in fault.right)
    if said and right(said[0]):
        return "named", said
    if said and here(said[0]) and said[0]["effect"] == "unknown" or any(right(f) for f in said):
        return "found", said
    return "missed", said


def main():
    o = options()
    urdfs = [os.path.join(make.HERE, "robots", name + ".urdf") for name in ("six", "seven")]
    arms, counts, told, extra = {}, {"named": 0, "found": 0, "missed": 0}, 0, 0
    wanted = SHORT if o.short else o.only.split(",") if o.only else [f.name for f in FAULTS]
    print("| fault | arm, place | said | result | verdict | right | a mechanic is told |\n|" + " --- |" * 7, flush=True)
    for k, fault in enumerate([f for f in FAULTS if f.name in wanted][:o.count]):
        which = k % len(urdfs)
        if which not in arms:
            arms[which] = Arm(o, urdfs[which], [o.seed, which], os.path.join(o.out, f"arm{which}"))
        arm = arms[which]
        arm.rng = np.random.default_rng([o.seed, which, k])
        made = arm.faulty(fault)
        if made is None:
            print(f"| {fault.name} | {arm.robot.n} joints | no motion shows it | | | | |", flush=True)
            continue
        report, look, new, joint = made
        result, said = verdict(fault, arm.robot, report, new, joint)
        counts[result] += 1
        words = bool(look) and bool(re.search(fault.words, " ".join(look[:1]), re.I))
        told += words
        extra += max(len(said) - (result != "missed"), 0)
        at = "whole arm" if joint is None else arm.robot.names[joint]
        first = f"{name_of(said[0])} {said[0].get('joint') or said[0].get('link') or ''}" if said else report.get("reason") or "nothing"
        more = f" and {len(said) - 1} more" if len(said) > 1 else ""
        print(f"| {fault.name} | {arm.robot.n} joints, {at} | {first}{more} | {result} | {report['verdict']} | {'yes' if result != 'missed' else 'no'} | "
              f"{look[0] if look else '-'}{'' if words else ' (not the part)'} |", flush=True)
    n = sum(counts.values())
    print(f"\nOf {n} faults, {counts['named']} are named, {counts['found']} more are found at their place, {counts['missed']} are missed. In {told} the part "
          f"that a mechanic is told first is the right one. {extra} further findings.")


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out")
    a.add_argument("--seed", type=int, default=1)
    a.add_argument("--count", type=int, default=len(FAULTS))
    a.add_argument("--only", help="only these faults, separated by commas")
    a.add_argument("--short", action="store_true", help="three faults on motions that are followed exactly")
    return a.parse_args()


if __name__ == "__main__":
    main()
