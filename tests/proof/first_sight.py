"""What `explain` says of faults that nobody drew before (unforeseen.py), and of arms that have none, on arms, clocks and noise of all kinds.

    python first_sight.py TAUSCOPE OUT --seed 1 [--kinds a,b] [--beside friction,bodies] [--twin-topic] [--nulls 6] [--table] [--cases]

Each fault is on an arm that is otherwise exact or, with `--beside friction,bodies`, as real ones are. Clocks are even, jittered, or uneven with
gaps; noise is white or partly slow. `found`: an `unknown`, or the nearest name of the list, at the joint; `place`: the same, but the `unknown` has
neither law nor curve (`without_law`); `near`: at a neighbour; `told`: only `remaining` names the joint; `silent`: none of it. A case that is there
already is not made again. Standard arms are those of `robots/`, and small_arm.py's.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import time

import numpy as np
import yaml

import judge
import make
import motion
import record
import small_arm
import unforeseen
from robot import Model, Robot

LIMIT_S = 240                        # of CPU: an explanation that takes longer is ended
FRICTION = {"viscous_friction", "coulomb_friction", "asymmetric_coulomb", "stribeck_friction", "presliding_hysteresis"}
BRISTLE_RAD = 4e-4


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out", type=pathlib.Path)
    a.add_argument("--seed", type=int, default=1)
    a.add_argument("--kinds", default=",".join(unforeseen.FAULTS), help="faults, separated by commas; none for nulls alone")
    a.add_argument("--beside", default="", help="friction, bodies or both, separated by commas")
    a.add_argument("--twin-topic", action="store_true", help="the twin is another simulation: late, spiky, with friction of its own")
    a.add_argument("--nulls", type=int, default=0, help="arms without a fault")
    a.add_argument("--make", action="store_true", help="only make the cases")
    a.add_argument("--table", action="store_true", help="only print the table of what is there")
    a.add_argument("--cases", action="store_true", help="say of each case what was said")
    return a.parse_args()


def names(o):
    """(case, fault or None, seed) of each case."""
    kinds = [k.strip() for k in o.kinds.split(",") if k.strip()]
    for k in kinds:
        yield f"{k}-{o.seed}", k, [o.seed, list(unforeseen.FAULTS).index(k)]
    for k in range(o.nulls):
        yield f"null{k}-{o.seed}", None, [o.seed, 900 + k]


def bristles(v):
    """Share of Coulomb friction along speeds: it holds at rest what it had when the joint stopped."""
    z, out = np.zeros(v.shape[1]), np.empty_like(v)
    for k, speed in enumerate(v):
        z = np.clip(z + 1e-3 * speed, -BRISTLE_RAD, BRISTLE_RAD)
        out[k] = z / BRISTLE_RAD
    return out


def arm(o, seed, rng):
    """A robot: one of the three standard ones or a small one."""
    if rng.random() < 0.5:
        return Robot(os.path.join(make.HERE, "robots", str(rng.choice(["six", "seven"])) + ".urdf"))
    path = o.out / "robots" / ("arm" + "_".join(map(str, seed)) + ".urdf")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(small_arm.urdf(path.stem, rng))
    return Robot(str(path))


def moving(robot, model, commands, starts, friction):
    """The arm along its commands, which it follows exactly."""
    out = []
    for command, start in zip(commands, starts):
        q = motion.smooth(command, 0.03)
        v, a = motion.derivatives(q)
        t = np.arange(len(q)) * 1e-3
        effort = model.rnea(q, v, a) + friction[0] * bristles(v) + friction[1] * v
        out.append(unforeseen.Moving(robot, t, start + t, q, v, a, effort))
    return out


def fault_of(kind, all_, fit, sigma, p, rng):
    """(joint or None, what it adds to the efforts, what it adds to the joint's angle) for each recording; None if nothing shows it."""
    fault, n = unforeseen.FAULTS[kind], all_[0].q.shape[1]
    target = float(np.exp(rng.uniform(np.log(10.), np.log(30.))))
    for j in (int(x) for x in rng.permutation(n)):
        if kind in unforeseen.OF_ARM:
            j = None
        if j is not None and np.ptp(np.concatenate([m.q[:, j] for m in all_])) < 0.3:
            continue
        parts = [fault(m, j, p) for m in all_]
        ratio = lambda x: float(np.sqrt((np.concatenate([y for y, f in zip(x, fit) if f])**2).mean(0) / sigma**2).max())
        if fault in unforeseen.POSITION:
            if ratio([misread(m, j, x) for m, x in zip(all_, parts)]) < 6.:
                continue
            return j, [0. * m.effort for m in all_], parts
        if callable(parts[0]):
            sizes = [sigma[j] * s for s in (target, 0.5 * target, 2. * target, 5. * target, 15. * target)]
            parts = min(([f(s) for f in parts] for s in sizes), key=lambda x: abs(np.log(max(ratio(x), 1e-9) / target)))
        else:
            size = target / max(ratio(parts), 1e-12)
            parts = [size * x for x in parts]
        if 4. < ratio(parts) < 1e3:
            return j, parts, None
        if j is None:
            return None
    return None


def misread(m, j, by):
    """What the twin's effort changes by where joint `j` reads so much more."""
    q = m.q[::10].copy()
    q[:, j] += by[::10]
    still = 0. * q
    return m.robot.nominal.rnea(q, still, still) - m.robot.nominal.rnea(m.q[::10], still, still)


def make_case(o, name, kind, seed):
    """Makes a case and its answer."""
    path = o.out / "answers" / f"{name}.json"
    if path.exists():
        return json.loads(path.read_text())
    rng = np.random.default_rng([*seed, bool(o.beside), o.twin_topic])
    robot = arm(o, seed, rng)
    for _ in range(20):
        answer = attempt(o, name, kind, robot, rng)
        if answer:
            break
    else:
        answer = {"none": "no motion shows it"}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(answer))
    return answer


def attempt(o, name, kind, robot, rng):
    count, out = 4, robot.n
    sigma = rng.uniform(0.8e-3, 1.45e-3, out) * robot.effort
    commands = [motion.draw(robot, rng, k, float(rng.uniform(6., 9.))) for k in rng.permutation(["via", "via", "fourier", "sweep"])]
    starts = np.cumsum([0.] + [len(c) * 1e-3 + float(rng.uniform(3., 20.)) for c in commands])
    held = int(rng.integers(0, count))
    beside = o.beside.split(",")
    friction = np.zeros((2, out))
    changed = {}
    if "friction" in beside or o.twin_topic:
        friction = sigma * np.exp(rng.uniform(np.log(5.), np.log(30.), (2, out)))
    if "bodies" in beside:
        off = lambda i: type(i)(i.mass * float(np.exp(rng.normal(0., 0.05))), i.com + rng.normal(0., 0.005, 3), i.about_com * float(np.exp(rng.normal(0., 0.1))))
        changed = {l.name: off(l.inertial) for l in robot.links.values() if l.body >= 0 and l.inertial is not None and l.inertial.mass > 0}
    all_ = moving(robot, Model(robot, changed=changed), commands, starts, friction)
    fit = [k != held for k in range(count)]
    joint, parts, turned = None, [0. * m.effort for m in all_], None
    if kind:
        join = lambda key: np.concatenate([getattr(m, key) for m, f in zip(all_, fit) if f])
        p = unforeseen.draw(float(starts[-1]), robot, join("q"), join("v"), join("effort"), rng)
        made = fault_of(kind, all_, fit, sigma, p, rng)
        if made is None:
            return None
        joint, parts, turned = made
    slow, clock = bool(rng.random() < 0.5), str(rng.choice(["even", "jitter", "uneven"]))
    rate, has_speed = int(rng.choice([100, 125, 250, 500])), bool(rng.random() < 0.7)
    # The other simulation is one program: its friction and its lateness are the same in all recordings.
    own, late = (rng.uniform(0.85, 1.15, (2, out)), float(rng.uniform(0.005, 0.02))) if o.twin_topic else (None, None)
    folder = o.out / "cases" / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(robot.stripped_urdf())
    squares = np.zeros(out)
    for k, m in enumerate(all_):
        write(o, folder / f"rec_{k}.mcap", robot, m, parts[k], None if turned is None else (joint, turned[k]), sigma, friction,
              {"slow": slow, "clock": clock, "rate": rate, "speed": has_speed, "own": own, "late": late}, rng)
        squares += (parts[k]**2).mean(0) / count
    case = {"case": name, "robot": "arm.urdf", "effort_unit": "Nm", "topics": {"state": "/joint_states"},
            "fit": [f"rec_{k}.mcap" for k in range(count) if fit[k]], "holdout": [f"rec_{held}.mcap"]}
    if o.twin_topic:
        del case["robot"]
        case |= {"twin": {"topic": "/twin/joint_states"}, "joint_names": robot.names}
    (folder / "case.yaml").write_text(yaml.safe_dump(case, sort_keys=False))
    return {"fault": kind, "joint": None if joint is None else robot.names[joint], "clock": clock, "slow": slow, "rate": rate, "robot": robot.name,
            "size": float((np.sqrt(squares) / sigma).max())}


def write(o, path, robot, m, part, turned, sigma, friction, around, rng):
    """Writes one recording."""
    rate, n = around["rate"], robot.n
    t = np.arange(int(m.t[-1] * rate)) / rate
    told = t.copy()
    if around["clock"] == "jitter":
        t[1:] += rng.uniform(-0.3, 0.3, len(t) - 1) / rate
        told = t.copy()
    if around["clock"] == "uneven":
        keep = (rng.random(len(t)) > 0.04) & ~((t > 0.4 * t[-1]) & (t < 0.4 * t[-1] + 0.06))
        t = t[keep]
        told = t + np.abs(rng.normal(0., min(8e-4, 0.1 / rate), len(t)))
    at = lambda x: np.stack([np.interp(t, m.t, c) for c in x.T], 1)
    white = rng.normal(size=(len(t), n))
    noise = np.sqrt(0.5) * (make.coloured(rng, t, n, float(rng.uniform(0.2, 0.9))) + white) if around["slow"] else white
    q, v = m.q.copy(), m.v.copy()
    if turned is not None:
        q[:, turned[0]] += turned[1]
        v[:, turned[0]] = np.gradient(q[:, turned[0]], 1e-3)
    q = np.round((at(q) + make.ENCODER_NOISE * rng.normal(size=(len(t), n))) / make.ENCODER_STEP) * make.ENCODER_STEP
    v = np.round((at(v) + make.SPEED_NOISE * rng.normal(size=(len(t), n))) * 1024) / 1024
    twin = None
    if o.twin_topic:
        own = around["own"] * friction
        effort = robot.nominal.rnea(m.q, m.v, m.a) + own[0] * np.tanh(m.v / 0.002) + own[1] * m.v
        twin = make.spikes(np.stack([np.interp(t - around["late"], m.t, c) for c in effort.T], 1), rng)
    ns = np.round((1.77e9 + m.session[0] + told) * 1e9).astype(np.int64)
    record.write(str(path), robot.names, np.maximum.accumulate(ns), q, v if around["speed"] else None, at(m.effort + part) + sigma * noise, None, twin)


def explain(o, name):
    """Explains a case; how long it took and the memory that it needed go beside the report."""
    folder = o.out / "reports" / name
    if (folder / "time.json").exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    command = ["/usr/bin/time", "-f", "%M", "-o", str(folder / "peak"), o.tauscope, "explain", str(o.out / "cases" / name / "case.yaml"), "--force", "--out"]
    limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    failed = subprocess.run([*command, str(folder / "out")], preexec_fn=limit, **quiet).returncode
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    peak = (folder / "peak").read_text().split() if (folder / "peak").exists() else []
    if (folder / "out" / "report.json").exists():
        os.replace(folder / "out" / "report.json", folder / "report.json")
        subprocess.run(["rm", "-r", folder / "out"], check=False)
    text = {"cpu_s": cpu, "wall_s": time.monotonic() - began, "peak_mb": int(peak[-1]) / 1024 if peak else None, "failed": failed}
    (folder / "time.json").write_text(json.dumps(text))


def judged(o, answer, report):
    """(found, place, near, told or silent; wrong findings) of a case."""
    joint, kind = answer["joint"], answer["fault"]
    robot = Robot(str(o.out / "cases" / report["case"] / "arm.urdf"))
    where = judge.places(robot)
    place = lambda f: where.get(f.get("joint") or f.get("link"))
    name_of = lambda f: f["parameters"].get("kind") or f["effect"]
    bodies = {"payload", "link_mass", "link_com", "link_inertia", "base_tilt"}
    best, wrong = "silent", []
    for f in report["findings"]:
        if f["confidence"] < 0.5:
            continue
        right = kind and (f["effect"] == "unknown" or name_of(f) in unforeseen.NEAREST.get(kind, ()))
        apart = 0 if joint is None or place(f) is None else abs(place(f) - where[joint])
        if right and apart == 0 and f["parameters"].get("kind") == "without_law":
            best = "place" if best != "found" else best
        elif right and apart == 0:
            best = "found"
        elif right and apart == 1 and best not in ("found", "place"):
            best = "near"
        elif kind and joint and apart == 0 and f["effect"] in FRICTION and kind in {x.__name__ for x in unforeseen.TORQUE}:
            continue                                # its share that plain friction is
        elif (o.beside or o.twin_topic) and (f["effect"] in FRICTION or f["effect"] in ("torque_delay", "torque_lowpass")):
            continue
        elif "bodies" in o.beside and (f["effect"] in bodies or f.get("link")):
            continue
        else:
            wrong.append(f)
    if best == "silent" and joint in {r["joint"] for r in report.get("remaining", [])} or best == "silent" and joint is None and report.get("remaining", []):
        best = "told"
    return best, wrong


def show(o):
    counts, seconds, peaks, sure, said_count = {}, [], [], 0, 0
    for name, kind, _ in names(o):
        path, answer = o.out / "reports" / name, o.out / "answers" / f"{name}.json"
        if not (path / "time.json").exists():
            continue
        answer, took = json.loads(answer.read_text()), json.loads((path / "time.json").read_text())
        seconds.append((took["cpu_s"], name))
        peaks.append((took["peak_mb"] or 0., name))
        if not (path / "report.json").exists():
            print("no report:", name, took)
            continue
        report = json.loads((path / "report.json").read_text())
        best, wrong = judged(o, answer, report)
        confident = [f for f in wrong if f["confidence"] > 0.9]
        sure, said_count = sure + len(confident), said_count + len([f for f in report["findings"] if f["confidence"] >= 0.5])
        key = "fault" if kind else "null"
        row = counts.setdefault(key, {"n": 0, "found": 0, "place": 0, "near": 0, "told": 0, "silent": 0, "wrong": 0, "verdict": 0})
        row["n"] += 1
        row[best] += 1
        row["wrong"] += len(wrong)
        # How far the other simulation's friction is off decides whether it is told.
        wanted = {"unknown_remains"} if kind else {"explained"} if o.beside else {"nothing_missing"} | {"explained"} if o.twin_topic else {"nothing_missing"}
        row["verdict"] += report["verdict"] in wanted
        if o.cases:
            text = [f"{f['parameters'].get('kind') or f['effect']}{'/' + f['parameters']['against'] if 'against' in f['parameters'] else ''}"
                    f"@{f.get('joint') or f.get('link') or ''} {f['confidence']:.2f}{' WRONG' if f in wrong else ''}" for f in report["findings"]]
            ratio = lambda k: [round(a / max(b, 1e-9), 1) for a, b in zip(report[k], report["noise_floor"])] if None not in report[k] else None
            print(f"{name} [{answer['joint']}, size {answer['size']:.0f}, {answer['clock']}, {'slow' if answer['slow'] else 'white'}, {answer['rate']} Hz, "
                  f"{answer['robot']}] {best.upper()} {report['verdict']} {took['cpu_s']:.0f} s\n    {text}\n    remaining "
                  f"{[(r['joint'], round(r['rms'] / r['noise'], 1)) for r in report.get('remaining', [])]}, hold-out over noise {ratio('holdout_rms_before')} to {ratio('holdout_rms_after')}")
    print("| | cases | found | place | near | told | silent | wrong findings | verdict as it should be |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for key, r in counts.items():
        print(f"| {key} | {r['n']} | {r['found']} | {r['place']} | {r['near']} | {r['told']} | {r['silent']} | {r['wrong']} | {r['verdict']} |")
    print(f"\nWrong with a confidence above 0.9: {sure} of {said_count} findings. Longest: {max(seconds)[0]:.0f} s of CPU ({max(seconds)[1]}); "
          f"most memory: {max(peaks)[0]:.0f} MB ({max(peaks)[1]}).")


def main():
    o = options()
    for name, kind, seed in names(o) if not o.table else ():
        answer = make_case(o, name, kind, seed)
        if "none" not in answer and not o.make:
            explain(o, name)
            print(name, flush=True)
    show(o) if not o.make else None


if __name__ == "__main__":
    main()
