"""How often a law comes back by its name: the faults of shop_floor.py, each on arms that are otherwise exact, or as real ones are.

    python named.py TAUSCOPE OUT [--first 31001] [--count 8] [--kinds friction_drift,late_brake] [--beside friction,bodies] [--table]

Case by case, from its seed: a small arm (small_arm.py), three recordings to fit and one held out, simulated by MuJoCo, under white or
partly slow noise. Then `explain`. `named` are the cases with a finding of that kind on that joint; `honest` those of the others with an
`unknown` on the joint; `wrong` the findings elsewhere or by another name, friction and bodies left out where the arm has them.
What is there already is not made again; `--table` makes nothing at all.
"""
import argparse
import contextlib
import io
import json
import pathlib

import numpy as np

import judge
import make
import shop_floor
import small_arm
from reliability import explain
from robot import Robot

FRICTION = {"viscous_friction", "coulomb_friction"}


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out", type=pathlib.Path)
    a.add_argument("--first", type=int, default=31001, help="seed of the first case; each further case of a kind has the next seed")
    a.add_argument("--count", type=int, default=8, help="cases of each kind")
    a.add_argument("--kinds", default=",".join(shop_floor.KINDS))
    a.add_argument("--beside", default="", help="friction, bodies or both, separated by commas")
    a.add_argument("--keep", action="store_true", help="keep the recordings")
    a.add_argument("--table", action="store_true", help="only print the table of what is there")
    a.add_argument("--cases", action="store_true", help="say of each case what was said")
    return a.parse_args()


def seeds(o):
    """(kind, seed) of each case."""
    kinds = o.kinds.split(",")
    for kind in kinds:
        for k in range(o.count):
            yield kind, o.first + 100 * shop_floor.KINDS.index(kind) + k


def make_case(o, kind, seed):
    """Makes a case; its answer, which says why there is none where the fault finds no place on this arm."""
    answer = o.out / "answers" / f"{seed:05d}.json"
    if answer.exists():
        return json.loads(answer.read_text())
    rng = np.random.default_rng([seed, 78])
    urdf = o.out / "robots" / f"arm{seed:05d}.urdf"
    for folder in (urdf.parent, answer.parent):
        folder.mkdir(parents=True, exist_ok=True)
    urdf.write_text(small_arm.urdf(urdf.stem, rng))
    slow = rng.random() < 0.4
    around = argparse.Namespace(
        seed=seed, strength=1., snr="8,40", several=0., no_constants=0., twin_topic=None, beside=o.beside, followed=False, recordings="3,1",
        seconds="6,8", rates=str(rng.choice([100, 125, 200])), clock="even", noise_correlation="0.02,0.9" if slow else "0,0",
        white_share=float(rng.uniform(0.2, 0.7)) if slow else 0.)
    try:
        made = make.case(around, f"c{seed:05d}", "unknown", [f"unknown:{kind}"], Robot(urdf), rng, str(o.out))
    except RuntimeError as error:
        made = {"none": str(error)}
    answer.write_text(json.dumps(made))
    return made


def said(finding):
    parameters = finding["parameters"]
    name = parameters.get("kind") or finding["effect"] + (f" over {parameters['against']}" if "against" in parameters else "")
    return f"{name}@{finding.get('joint') or finding.get('link') or ''} {finding['confidence']:.2f}"


def judged(o, kind, seed):
    """(named, honest, wrong findings, all that was said) of a case, or None where there is none."""
    paths = [o.out / "answers" / f"{seed:05d}.json", o.out / "reports" / f"{seed:05d}.json"]
    if not all(p.exists() for p in paths):
        return None
    answer, report = (json.loads(p.read_text()) for p in paths)
    if "none" in answer or "failed" in report:
        return None
    (fault,), findings = answer["effects"], report["findings"]
    here = [f for f in findings if f["effect"] == "unknown" and f["joint"] == fault["joint"] and not f.get("link")]
    named = any(f["parameters"].get("kind") == kind for f in here)
    robot = Robot(o.out / "robots" / f"{answer['robot']}.urdf")
    off = [fault, *answer.get("background", [])]
    verdicts = judge.judge(findings, off, robot)
    wrong = [f for f, v in zip(findings, verdicts) if v == "wrong" and not (o.beside and f["effect"] in FRICTION)]
    others = [f for f in here if f["parameters"].get("kind") not in (None, kind)]
    return named, bool(here) and not named, wrong + others, report, fault


def show(o):
    print("| fault | cases | named | unknown at the joint | wrong findings | verdicts `unknown_remains` |\n| --- | --- | --- | --- | --- | --- |")
    every = [0] * 4
    for kind in o.kinds.split(","):
        rows = [(seed, judged(o, kind, seed)) for own, seed in seeds(o) if own == kind]
        rows = [(seed, row) for seed, row in rows if row]
        count = lambda of: sum(of(row) for _, row in rows)
        own = [len(rows), *(count(of) for of in (lambda r: r[0], lambda r: r[1], lambda r: len(r[2])))]
        every = [a + b for a, b in zip(every, own)]
        print(f"| `{kind}` | {' | '.join(map(str, own))} | {count(lambda r: r[3]['verdict'] == 'unknown_remains')} |")
        for seed, row in rows if o.cases else ():
            print("   ", seed, fault_text(row[4]), "SAID", [said(f) for f in row[3]["findings"]], row[3]["verdict"])
    print(f"\nOf {every[0]} faults, {every[1]} come back by name, {every[2]} more as an `unknown` at their joint. {every[3]} findings are wrong.")


def fault_text(fault):
    values = " ".join(f"{k}={v:.3g}" for k, v in fault["parameters"].items() if isinstance(v, float))
    return f"{fault['joint']} snr {fault['snr_rms']:.0f} {values}"


def main():
    o = options()
    for kind, seed in () if o.table else seeds(o):
        with contextlib.redirect_stderr(io.StringIO()):
            answer = make_case(o, kind, seed)
        if "none" in answer:
            print(seed, kind, answer["none"][:200], flush=True)
            continue
        report = explain(o, seed)
        print(seed, kind, "failed" if report is None else report["verdict"], flush=True)
    show(o)


if __name__ == "__main__":
    main()
