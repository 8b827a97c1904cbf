"""Make cases of arms with concealed physics: recordings, case files and the answers.

    python make.py --out DIR --seed 1 --count 20 [--kind single|combo|null|unknown|arm|mixed] [--effects a,b] [--robots DIR_OR_FILES ...]

DIR gets cases/<id>/{case.yaml, rec_XX.mcap}, robots/*.urdf, answers.json and its sha256.  The same call gives the same bytes.
"""
import argparse
import glob
import hashlib
import json
import os
import sys

import numpy as np
import yaml

import draws
import motion
import record
import truth
import shop_floor
from effects import RECORD, formula
from plant import Log, Plant
from robot import Robot

ENCODER_STEP, ENCODER_NOISE, SPEED_NOISE = 2.**-17, 2.5e-5, 8e-4   # rad, rad, rad/s; a fifth of it in m for a slide
HERE = os.path.dirname(os.path.abspath(__file__))


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("--out", required=True)
    a.add_argument("--seed", type=int, default=1)
    a.add_argument("--count", type=int, default=10)
    a.add_argument("--kind", default="mixed", choices=["single", "combo", "null", "unknown", "arm", "mixed"])
    a.add_argument("--plan", help="kinds and effects case by case instead, e.g. 'payload;coulomb_friction+torque_delay;null;unknown:torque_bump'")
    a.add_argument("--effects", help="only these, separated by commas")
    a.add_argument("--robots", nargs="+", default=[os.path.join(HERE, "robots")], help="URDF files or folders of them")
    a.add_argument("--strength", type=float, default=1., help="scales every effect")
    a.add_argument("--snr", default="6,50", help="range of an effect's rms over noise, before --strength")
    a.add_argument("--rates", default="100,125", help="Hz, divisors of 1000")
    a.add_argument("--clock", default="even", choices=["even", "uneven"])
    a.add_argument("--noise-correlation", default="0,0", help="range of the correlation time of the torque noise, s")
    a.add_argument("--white-share", type=float, default=0., help="share of the power of correlated noise that is white after all")
    a.add_argument("--recordings", default="4,2", help="to fit, held out")
    a.add_argument("--seconds", default="8.5,10", help="range of a recording's length")
    a.add_argument("--several", type=float, default=0., help="probability that an effect of a combination comes on a second joint too")
    a.add_argument("--no-constants", type=float, default=0., help="share of the cases in A that do not give torque constants")
    a.add_argument("--twin-topic", nargs="?", const="encoder", choices=["encoder", "foreign"], help="the twin is a topic in the recordings: "
                   "the nominal arm from the encoder's derivatives, or another simulation of the command, late, with friction and spikes of its own")
    a.add_argument("--beside", default="", help="what the arm has beside the effects, and the answers list as `background`: friction, bodies or both, separated by commas")
    a.add_argument("--followed", action="store_true", help="no plant: every command is followed exactly. Not for gears, nor for what cuts a motor")
    a.add_argument("--prefix", default="c")
    return a.parse_args()


def pair(text, kind=float):
    a, b = (kind(x) for x in text.split(","))
    return a, b


def plan(o, rng, robots):
    """Per case: (kind, names of effects, robot)."""
    allowed = o.effects.split(",") if o.effects else draws.EFFECTS
    rows, deck = [], []
    if o.plan:
        for text in o.plan.split(";"):
            names = [] if text == "null" else text.split("+")
            kind = "null" if not names else "unknown" if ":" in text else "single" if len(names) == 1 else "combo"
            rows.append((kind, names))
    for i in range(o.count if not o.plan else 0):
        kind = o.kind if o.kind != "mixed" else str(rng.choice(["single", "combo", "null", "unknown"], p=[0.45, 0.35, 0.1, 0.1]))
        if kind == "null":
            names = []
        elif kind == "unknown":
            names = ["unknown:" + draws.UNKNOWN[i % len(draws.UNKNOWN)]]
        elif kind == "arm":
            names = None                        # drawn for the robot
        elif kind == "single":
            deck = deck or [str(x) for x in rng.permutation(allowed)]
            names = [deck.pop()]
        else:
            names = draws.together([x for x in allowed if x != "temperature_viscous"], int(rng.integers(2, 5)), rng)
        rows.append((kind, names))
    order = []
    for kind, names in rows:
        order = order or [robots[k] for k in rng.permutation(len(robots))]
        robot = order.pop()
        yield kind, draws.whole_arm(robot.n, rng) if kind == "arm" else names, robot


def set_up(o, names, robot, rng):
    """Recordings of a case: names, commanded positions, starts in the session, which to fit."""
    long = "temperature_viscous" in names
    fit, held = (2, 1) if long else pair(o.recordings, int)
    low, high = (140., 180.) if long else pair(o.seconds)
    recs = [f"rec_{k:02d}" for k in range(fit + held)]
    kinds = [str(x) for x in rng.choice(["via", "fourier", "sweep"], len(recs), p=[0.5, 0.32, 0.18])]
    if long:
        kinds = ["fourier" if k == "sweep" else k for k in kinds]
    out = [0] if len(recs) == 1 else sorted(int(x) for x in rng.choice(len(recs), held, replace=False))
    use = [k for k in range(len(recs)) if k not in out]
    for k, want in zip(rng.permutation(use), ("via", "fourier")):      # always some rest and some richness to fit on
        kinds[k] = want
    commands = [motion.draw(robot, rng, k, round(float(rng.uniform(low, high)), 1)) for k in kinds]
    starts = [0.]
    for c in commands[:-1]:
        starts.append(starts[-1] + len(c) / motion.RATE + float(rng.uniform(5., 30.)))
    return recs, kinds, commands, starts, [recs[k] for k in use]


def concealed(o, kind, names, c, rng):
    """The effects of one case, or None if one of them finds no place."""
    low, high = pair(o.snr)
    effects = []
    for name in names:
        again = kind == "combo" and rng.random() < o.several and draws.CLASS[name] not in draws.ONCE | {"alone"}
        for _ in range(1 + again):
            target = o.strength * float(np.exp(rng.uniform(np.log(low), np.log(high))))
            e = next((x for x in (draws.draw(name, c, rng, target, effects if kind != "arm" else ()) for _ in range(4)) if x), None)
            if e is None and kind == "arm" and "@" in name:      # not every joint can show everything
                continue
            if e is None:
                return None
            effects.append(e)
    return effects


def background(o, c, rng):
    """What the arm has beside what is concealed in it: friction on every joint, and bodies a little off the URDF."""
    beside, out = [x for x in o.beside.split(",") if x], []
    if "friction" in beside:
        for name in (f"{kind}_friction@{j}" for j in range(c.robot.n) for kind in ("coulomb", "viscous")):
            e = draws.draw(name, c, rng, float(np.exp(rng.uniform(np.log(5.), np.log(30.)))))
            out += [e] if e else []
    return out + ([draws.bodies_off(c, rng)] if "bodies" in beside else [])


def foreign(robot, effects, m, rng):
    """(times, efforts) of another simulation of the arm: it follows the command exactly, has friction of its own, and is late.
    `m` is the commanded motion. One row in 400 has a spike on some joints."""
    friction = [e for e in effects if e["effect"] in ("coulomb_friction", "viscous_friction")]
    _, parts = truth.contributions(robot, friction, m)
    effort = robot.nominal.rnea(m.q, m.v, m.a) + sum((float(rng.uniform(0.85, 1.15)) * p for p in parts), np.zeros(m.q.shape))
    return m.t + float(rng.uniform(0.005, 0.02)), effort


def spikes(x, rng):
    """Efforts with spikes of a single row."""
    hit = (rng.random(len(x)) < 1. / 400.)[:, None] & (rng.random(x.shape) < 0.4)
    return x + hit * rng.normal(size=x.shape) * 3. * rms(x)


def stamps(o, rng, seconds, rate):
    """Times [s] of a recording's rows, and how each row repeats an earlier one (index into itself)."""
    t = np.arange(int(seconds * rate)) / rate
    if o.clock == "even":
        return t, np.arange(len(t))
    t[1:] += rng.uniform(-0.2, 0.2, len(t) - 1) / rate
    keep = rng.random(len(t)) > 0.02
    keep[0] = True
    t = np.minimum(t[keep], seconds - 1e-3)
    return t, np.sort(np.concatenate([np.arange(len(t)), np.flatnonzero(rng.random(len(t)) < 0.02)]))


def coloured(rng, t, n, correlation):
    """Unit noise (samples x n), white or with the given correlation time."""
    x = rng.normal(size=(len(t), n))
    if correlation > 0:
        rho = np.exp(-np.diff(t) / correlation)
        for k in range(1, len(t)):
            x[k] = rho[k - 1] * x[k - 1] + np.sqrt(1 - rho[k - 1]**2) * x[k]
    return x


def rms(x):
    return np.sqrt((x**2).mean(0))


def simulate(robot, effects, recs, commands, starts):
    """Logs of all recordings, or the reason why one is no good."""
    plant = Plant(robot, effects, commands)
    logs = []
    for name, command, start in zip(recs, commands, starts):
        logs.append(plant.record(name, command, start))
        if logs[-1].trouble:
            return None, logs[-1].trouble
    return logs, None


def followed(robot, effects, recs, commands, starts):
    """Logs of motions that are as they were commanded, with the torques that they take: no plant, so in a tenth of the time."""
    physics, logs = [e for e in effects if formula(e) not in RECORD], []
    for name, command, start in zip(recs, commands, starts):
        command = motion.smooth(command, 0.03)
        m = truth.of_command(name, start, command, stride=1)
        rigid, parts = truth.contributions(robot, physics, m)
        logs.append(Log(m.t, m.q, m.v, m.a, m.q, m.v, m.a, rigid + sum(parts), command, 0. * m.q, None))
    return logs, None


def case(o, ident, kind, names, robot, rng, folder):
    """Draw, simulate and check until a case is sound; write its files; its entry in the answers."""
    rejected = []
    for _ in range(25):
        entry = attempt(o, ident, kind, names, robot, rng, folder, rejected)
        if entry:
            return entry
    raise RuntimeError(f"{ident}: no sound case of {names} on {robot.name}: {rejected[-5:]}")


def attempt(o, ident, kind, names, robot, rng, folder, rejected):
    recs, kinds, commands, starts, fit = set_up(o, names, robot, rng)
    sigma = rng.uniform(0.8e-3, 1.45e-3, robot.n) * robot.effort
    c = draws.Context(robot, [truth.of_command(*x) for x in zip(recs, starts, commands)], fit, sigma)
    effects = concealed(o, kind, names, c, rng)
    if effects is None:
        rejected.append("no place to show an effect")
        return None
    asked, effects = len(effects), effects + background(o, c, rng)
    logs, trouble = (followed if o.followed else simulate)(robot, effects, recs, commands, starts)
    if trouble:
        rejected.append(trouble)
        return None

    # How visible each effect is, and whether the record closes.
    shown, closure = {r: None for r in recs}, 0.
    for r, s, log in zip(recs, starts, logs):
        m = truth.of_log(r, s, log)
        rigid, parts = truth.contributions(robot, effects, m)
        clean = truth.recorded(robot, effects, log, s)
        shown[r] = (m, rigid, parts, clean)
        gap = (clean - rigid - sum(parts)) / sigma
        closure = max(closure, float(rms(gap).max()))
    views = [truth.visibility(robot, e, [(shown[r][0], shown[r][1], shown[r][2][k]) for r in fit], sigma)
             for k, e in enumerate(effects[:asked])]
    if closure > 0.25:
        rejected.append(f"does not close: {closure:.2f} of the noise")
        return None
    low = min(1., 0.35 * o.strength * pair(o.snr)[0])
    if kind != "arm" and any(v.get("snr_distinct", 9.) < low or v["snr_rms"] < 0.3 * low for v in views):
        rejected.append("not distinct")
        return None

    unit = "A" if rng.random() < 0.35 else "Nm"
    constant = robot.effort / rng.uniform(4., 12., robot.n) if unit == "A" else np.ones(robot.n)
    rate = int(rng.choice([int(x) for x in o.rates.split(",")]))
    correlation = float(rng.uniform(*pair(o.noise_correlation)))
    has_speed, has_command, hidden = rng.random() > 0.25, rng.random() < 0.5, rng.random() < o.no_constants
    order = rng.permutation(robot.n) if rng.random() < 0.4 else np.arange(robot.n)
    speed_step = 2.**-float(rng.choice([10, 12]))
    epoch = int(rng.integers(1_760_000_000, 1_770_000_000))
    held = [r for r in recs if r not in fit]
    figures, files = {}, []
    for r, start, command in zip(recs, starts, commands):
        m, rigid, _, clean = shown[r]
        t, rows = stamps(o, rng, len(command) / motion.RATE, rate)
        at = lambda x: np.stack([np.interp(t, m.t, column) for column in x.T], 1)
        noise = coloured(rng, t, robot.n, correlation) * sigma
        if o.white_share:
            noise = np.sqrt(1 - o.white_share) * noise + np.sqrt(o.white_share) * rng.normal(size=noise.shape) * sigma
        measured, true_rigid = at(clean) + noise, at(rigid)
        fine = np.where(robot.slides, 0.2, 1.)
        q = np.round((at(m.q) + fine * ENCODER_NOISE * rng.normal(size=measured.shape)) / (fine * ENCODER_STEP)) * fine * ENCODER_STEP
        v = np.round((at(m.v) + fine * SPEED_NOISE * rng.normal(size=measured.shape)) / (fine * speed_step)) * fine * speed_step
        ns = epoch * 10**9 + np.round((start + t) * 1e9).astype(np.int64)
        pick = lambda x: x[rows][:, order]
        practical = robot.nominal.rnea(*truth.estimated(t, q))
        twin = practical
        if o.twin_topic == "foreign":
            late, effort = foreign(robot, effects, truth.of_command(r, start, command), np.random.default_rng(epoch))
            twin = spikes(np.stack([np.interp(t, late, column) for column in effort.T], 1), rng)
        files.append((r, ns[rows], pick(q), pick(v) if has_speed else None, pick(measured / constant),
                      pick(at(command)) if has_command else None, pick(twin / constant) if o.twin_topic else None))
        if r in held:
            cut = int(len(t) / (t[-1] - t[0]) * truth.CUT)
            within = slice(cut, -cut)
            figures[r] = {k: (x / constant)[within] for k, x in {
                "tau_clean_rms": at(clean), "before": measured - true_rigid, "floor": noise,
                "before_practical": measured - practical, "floor_practical": noise + true_rigid - practical}.items()}
    pooled = {k: rms(np.concatenate([figures[r][k] for r in held])).tolist() for k in figures[held[0]]}
    over = lambda k: float(((np.array(pooled[k]) * constant / sigma)**2).sum())
    extra = over("floor_practical") - over("floor")
    if not o.beside and extra > max(0.4 * (over("before") - over("floor")), 0.8 * robot.n):
        rejected.append(f"chatter: estimated derivatives miss {extra:.1f} squared noises")
        return None

    path = os.path.join(folder, "cases", ident)
    os.makedirs(path, exist_ok=True)
    names_out = [robot.names[k] for k in order]
    for r, *columns in files:
        record.write(os.path.join(path, r + ".mcap"), names_out, *columns)
    topics = {"state": "/joint_states"} | ({"command": "/joint_commands"} if has_command else {})
    text = {"case": ident, "robot": f"../../robots/{robot.name}.urdf", "effort_unit": unit, "joint_names": robot.names, "rate_hz": rate,
            "topics": topics, "has_velocity": bool(has_speed), "fit": [r + ".mcap" for r in fit], "holdout": [r + ".mcap" for r in held]}
    if o.twin_topic:
        del text["robot"]
        text["twin"] = {"topic": "/twin/joint_states"}
    if unit == "A" and not hidden:
        text["torque_constants_nm_per_a"] = dict(zip(robot.names, constant.tolist()))
    with open(os.path.join(path, "case.yaml"), "w") as file:
        yaml.safe_dump(text, file, sort_keys=False)
    return {"case": ident, "robot": robot.name, "kind": kind, "effects": [e | v for e, v in zip(effects, views)],
            "effort_unit": unit, "joint_names": robot.names, "noise_sigma": (sigma / constant).tolist(),
            "noise_correlation_s": correlation, "motions": dict(zip(recs, kinds)), "session_start": dict(zip(recs, starts)),
            "duration": {r: len(x) / motion.RATE for r, x in zip(recs, commands)}, "fit": fit, "holdout_names": held,
            "holdout": pooled, "per_recording": {r: {k: rms(x).tolist() for k, x in figures[r].items()} for r in held},
            "closure_sigma": closure, "rejected": rejected} | ({"background": effects[asked:]} if o.beside else {})


def main():
    o = options()
    paths = [p for x in o.robots for p in (sorted(glob.glob(os.path.join(x, "*.urdf"))) if os.path.isdir(x) else [x])]
    robots = [Robot(p) for p in paths]
    os.makedirs(os.path.join(o.out, "robots"), exist_ok=True)
    answers = []
    for i, (kind, names, robot) in enumerate(plan(o, np.random.default_rng([o.seed, 999_983]), robots)):
        with open(os.path.join(o.out, "robots", robot.name + ".urdf"), "w") as file:
            file.write(robot.stripped_urdf())
        try:
            answers.append(case(o, f"{o.prefix}{i:02d}", kind, names, robot, np.random.default_rng([o.seed, i]), o.out))
        except RuntimeError as error:            # such a set of effects cannot be shown on this robot: the case is left out
            print(error, file=sys.stderr)
            continue
        a = answers[-1]
        print(a["case"], a["kind"], a["robot"], [(e["effect"], e.get("joint", e.get("link")), round(e["snr_rms"], 1)) for e in a["effects"]],
              f"closure {a['closure_sigma']:.3f}", "rejected", len(a["rejected"]), flush=True)
        text = json.dumps({"cases": answers}, indent=1) + "\n"
        with open(os.path.join(o.out, "answers.json"), "w") as file:
            file.write(text)
        with open(os.path.join(o.out, "answers.sha256"), "w") as file:
            file.write(hashlib.sha256(text.encode()).hexdigest() + "  answers.json\n")


if __name__ == "__main__":
    main()
