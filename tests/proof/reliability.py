"""What a confidence is worth: of the findings said with 0.9, how many are right?

    python reliability.py TAUSCOPE OUT [--first 6001] [--cases 1000] [--table] [--half even|odd] [--fit] [--svg FILE]

Case by case, from its seed: a small arm (small_arm.py), recordings of it by `make.py`'s generator with an effect of the library, two to four
at once, nothing (all under white noise or partly slow noise), something off the library (`make.py`'s and off_list.py's), or an arm as real ones
are (friction everywhere, its bodies off, and in half of the cases something off the library besides). MuJoCo integrates a quarter of them; of the
others, and of whole arms, the motion is as commanded (`make.py --followed`), which is faster. Then `explain`, and each finding judged
by name and place (judge.py). What is there already is not made again; `--table` makes nothing at all. `--fit` prints the two numbers of
CONFIDENCE in explain/src/report/findings.rs, as a logistic regression of right or wrong on these findings gives them.
"""
import argparse
import collections
import contextlib
import io
import json
import math
import pathlib
import shutil
import subprocess

import numpy as np

import draws
import judge
import make
import off_list
import small_arm
from robot import Robot

EDGES = [0., 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0001]
WORDS = {"single": "one effect of the library", "combo": "two to four effects of the library",
         "null": "nothing hidden, white or partly slow noise", "unknown": "an effect that the library lacks",
         "arm": "a whole arm: friction on every joint, bodies that differ from the URDF"}
KINDS = {"single": 0.34, "combo": 0.24, "null": 0.1, "unknown": 0.2, "arm": 0.12}
LIMIT_S = 240.                       # an explanation that takes longer is left out


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out", type=pathlib.Path)
    a.add_argument("--first", type=int, default=6001, help="seed of the first case")
    a.add_argument("--cases", type=int, default=1000)
    a.add_argument("--keep", action="store_true", help="keep the recordings")
    a.add_argument("--table", action="store_true", help="only print the table of what is there")
    a.add_argument("--half", choices=["even", "odd"], help="these seeds only")
    a.add_argument("--fit", action="store_true")
    a.add_argument("--svg", type=pathlib.Path, help="draw the reliability diagram there")
    return a.parse_args()


def plan(seed, joints, rng):
    """Kind of a case, the names of its effects and what surrounds them."""
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    library = [x for x in draws.EFFECTS if x != "temperature_viscous"]       # which wants recordings of minutes
    off = "unknown:" + str(rng.choice(draws.UNKNOWN + off_list.KINDS))
    names = {"single": lambda: [library[seed // 2 % len(library)]],
             "combo": lambda: draws.together(library, int(rng.integers(2, 5)), rng),
             "null": list,
             "unknown": lambda: [off],
             "arm": lambda: ["bodies_off", *draws.whole_arm(joints, rng), *([off] if rng.random() < 0.5 else [])]}[kind]()
    slow, plant = rng.random() < 0.4, rng.random() < 0.25
    followed = kind == "arm" or not plant and not {"joint_elasticity", "backlash", "torque_saturation"} & set(names)
    around = argparse.Namespace(
        seed=seed, strength=1., snr="6,50", several=0.2, no_constants=0.3, twin_topic=None, beside="", followed=followed, recordings="3,1",
        seconds="4.5,6.5", rates=str(rng.choice([100, 125, 200])), clock=str(rng.choice(["even", "uneven"], p=[0.7, 0.3])),
        noise_correlation="0.02,0.9" if slow else "0,0", white_share=float(rng.uniform(0.2, 0.7)) if slow else 0.)
    return kind, names, around


def make_case(out, seed):
    """Makes a case; its answer, which says why there is none where its effects find no place on this arm."""
    answer = out / "answers" / f"{seed:05d}.json"
    if answer.exists():
        return json.loads(answer.read_text())
    rng = np.random.default_rng([seed, 77])
    urdf = out / "robots" / f"arm{seed:05d}.urdf"
    for folder in (urdf.parent, answer.parent):
        folder.mkdir(parents=True, exist_ok=True)
    urdf.write_text(small_arm.urdf(urdf.stem, rng))
    robot = Robot(urdf)
    kind, names, around = plan(seed, robot.n, rng)
    try:
        made = make.case(around, f"c{seed:05d}", kind, names, robot, rng, str(out))
    except RuntimeError as error:
        made = {"none": str(error)}
    answer.write_text(json.dumps(made))
    return made


def explain(o, seed):
    """What `explain` says of a case, or None."""
    report = o.out / "reports" / f"{seed:05d}.json"
    if not report.exists():
        folder = o.out / "explained" / f"{seed:05d}"
        case = o.out / "cases" / f"c{seed:05d}"
        try:
            subprocess.run([o.tauscope, "explain", case / "case.yaml", "--force", "--out", folder], check=True, timeout=LIMIT_S,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            text = (folder / "report.json").read_text()
        except (subprocess.SubprocessError, OSError) as error:
            text = json.dumps({"failed": str(error)})
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(text)
        shutil.rmtree(folder, ignore_errors=True)
        if not o.keep:
            shutil.rmtree(case, ignore_errors=True)
    said = json.loads(report.read_text())
    return None if "failed" in said else said


def judged(o, seed):
    """(kind, findings with their judgement, concealed effects, report) of a case, or None where there is none yet, or none at all."""
    paths = [o.out / "answers" / f"{seed:05d}.json", o.out / "reports" / f"{seed:05d}.json"]
    if not all(p.exists() for p in paths):
        return None
    answer, report = (json.loads(p.read_text()) for p in paths)
    if "none" in answer or "failed" in report:
        return None
    robot = Robot(o.out / "robots" / f"{answer['robot']}.urdf")
    findings = report["findings"]
    return answer["kind"], list(zip(findings, judge.judge(findings, answer["effects"], robot))), answer["effects"], report


def wilson(right, count, z=1.96):
    """95 % interval of a share."""
    if not count:
        return 0., 1.
    p, n = right / count, count
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def table(pairs):
    """Bins of (confidence, right), in Markdown."""
    lines = ["| confidence said | findings | mean confidence | right | 95 % interval |", "| --- | --- | --- | --- | --- |"]
    for low, high in zip(EDGES, EDGES[1:]):
        own = [(c, r) for c, r in pairs if low <= c < high]
        if own:
            right = sum(r for _, r in own)
            a, b = wilson(right, len(own))
            lines.append(f"| {low:.2f} to {min(high, 1.):.2f} | {len(own)} | {sum(c for c, _ in own) / len(own):.3f} | "
                         f"{right / len(own):.3f} | {a:.3f} to {b:.3f} |")
    return "\n".join(lines)


def svg(pairs):
    """Share right over mean confidence by bin, with 95 % intervals; the diagonal is what is promised."""
    at = lambda c, r: (60 + 400 * c, 440 - 400 * r)
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 500 500" font-family="sans-serif" font-size="13">',
             '<rect width="500" height="500" fill="white"/>', '<path d="M60 440 L460 40" stroke="#999" stroke-dasharray="5 4"/>',
             '<path d="M60 40 V440 H460" fill="none" stroke="black"/>']
    for tick in (0., 0.25, 0.5, 0.75, 1.):
        x, y = at(tick, tick)
        parts += [f'<text x="{x:.0f}" y="460" text-anchor="middle">{tick}</text>', f'<text x="52" y="{y + 4:.0f}" text-anchor="end">{tick}</text>']
    for k, (low, high) in enumerate(zip(EDGES, EDGES[1:])):
        own = [(c, r) for c, r in pairs if low <= c < high]
        if own:
            mean, right = sum(c for c, _ in own) / len(own), sum(r for _, r in own)
            (x, y), ends = at(mean, right / len(own)), [at(mean, e)[1] for e in wilson(right, len(own))]
            parts += [f'<path d="M{x:.1f} {ends[0]:.1f} V{ends[1]:.1f}" stroke="#1f6feb" stroke-width="2"/>',
                      f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#1f6feb"/>',
                      f'<text x="{x:.1f}" y="{max(ends) + 15 + 13 * (k % 3):.1f}" text-anchor="middle" fill="#555">{len(own)}</text>']
    parts += ['<text x="260" y="485" text-anchor="middle">mean confidence of the findings in a bin</text>',
              '<text x="18" y="240" text-anchor="middle" transform="rotate(-90 18 240)">share of them that is right</text>', "</svg>"]
    return "\n".join(parts) + "\n"


def grounds(finding):
    """The row of a finding in the regression: as in findings.rs."""
    margin = finding["evidence_nats"]
    return [1., math.copysign(math.log1p(abs(margin)), margin)]


def regression(rows, right, spread=2.):
    """Logistic regression by Newton's method; what few findings tell of stays within a `spread` or so of nothing."""
    a, y = np.array(rows), np.array(right, float)
    held, b = np.eye(a.shape[1]) / spread**2, np.zeros(a.shape[1])
    for _ in range(50):
        p = 1. / (1. + np.exp(-a @ b))
        b += np.linalg.solve((a * (p * (1. - p))[:, None]).T @ a + held, a.T @ (y - p) - held @ b)
    return b


def seeds(o):
    """Seeds of the cases that are asked for."""
    return [seed for seed in range(o.first, o.first + o.cases) if o.half is None or seed % 2 == (o.half == "odd")]


def show(o):
    pairs, by_kind, neither, cases, rows = [], collections.defaultdict(list), 0, collections.Counter(), []
    for seed in seeds(o):
        case = judged(o, seed)
        if case is None:
            continue
        kind, findings, _, _ = case
        cases[kind] += 1
        for finding, verdict in findings:
            if verdict is None:
                neither += 1
                continue
            pairs.append((finding["confidence"], verdict == "right"))
            by_kind[kind].append(pairs[-1])
            if o.fit:
                rows.append(grounds(finding))
    print(f"{sum(cases.values())} cases ({', '.join(f'{n} {k}' for k, n in sorted(cases.items()))}), {len(pairs)} findings judged, {neither} neither right nor wrong\n")
    print(table(pairs))
    print("\n| kind | findings | mean confidence | right | said with 0.9 or more | of them right |\n| --- | --- | --- | --- | --- | --- |")
    for kind in KINDS:
        own, sure = by_kind[kind], [r for c, r in by_kind[kind] if c >= 0.9]
        mean = lambda x: f"{sum(x) / len(x):.3f}" if x else ""
        print(f"| {WORDS[kind]} | {len(own)} | {mean([c for c, _ in own])} | {mean([r for _, r in own])} | {len(sure)} | {mean(sure)} |")
    if o.fit:
        base, slope = regression(rows, [r for _, r in pairs])
        print(f"\nCONFIDENCE: [{base:.2f}, {slope:.2f}]")
    if o.svg:
        o.svg.write_text(svg(pairs))


def main():
    o = options()
    for seed in seeds(o) if not o.table else ():
        with contextlib.redirect_stderr(io.StringIO()):
            answer = make_case(o.out, seed)
        if "none" not in answer:
            said = explain(o, seed)
            print(seed, answer["kind"], "failed" if said is None else said["verdict"], flush=True)
    show(o)


if __name__ == "__main__":
    main()
