"""Does an answer hang on the exact value of a constant? Varies those marked `Tuned:` by +-30 % on fresh cases and prints what changes.

    python vary.py OUT --list                                              # which there are
    python vary.py OUT [--only REGEX] [--sample 20 --seed 1]               # one at a time
    python vary.py OUT --groups [--seed 1]                                 # all at once with random signs, halved where something changes

The tree is copied to OUT/tree and built once, with every such constant scaled by what the environment says (vary_source.py). A variation
then costs the cases: `--cases` small arms (reliability.py, from seed `--first` on) for constants of explain and dynamics, `--sets`
simulated sets of hands on random paths (tests/contacts/paths.py) for those of stages/detect. Printed are findings that come or go, by name and place,
F1, the error on the hold-out, contacts found and false alarms. All runs are kept in OUT and not made again.
"""
import argparse
import hashlib
import json
import os
import pathlib
import random
import subprocess
import sys

import judge
import reliability
import vary_source
from robot import Robot

HERE = pathlib.Path(__file__).resolve().parent
TREE = HERE.parents[1]
HOLDOUT = 0.05                       # a smaller change of the hold-out's error is not told


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("out", type=pathlib.Path)
    a.add_argument("--list", action="store_true")
    a.add_argument("--only", default="", help="constants whose file:NAME matches")
    a.add_argument("--crates", default=",".join(vary_source.CRATES))
    a.add_argument("--sample", type=int, help="so many of them, drawn at random")
    a.add_argument("--groups", action="store_true")
    a.add_argument("--seed", type=int, default=1, help="of the draw and of the signs")
    a.add_argument("--by", type=float, default=0.3)
    a.add_argument("--cases", type=int, default=24)
    a.add_argument("--sets", type=int, default=2)
    a.add_argument("--first", type=int, default=900_001, help="seed of the first case and set")
    a.add_argument("--target", type=pathlib.Path, help="cargo's target folder; OUT/target unless told")
    return a.parse_args()


def run(*command, **env):
    subprocess.run([str(x) for x in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **env})


class Lab:
    """The program with its constants in the environment, and the cases to run it on."""

    def __init__(self, o, program, constants):
        self.o, self.program, self.constants = o, program, constants
        # Another build is another program: none of its runs are taken for this one's.
        self.build = hashlib.sha256(pathlib.Path(program).read_bytes()).hexdigest()[:12]
        explains = any(c.crate != "stages/detect" for c in constants)
        detects = any(c.crate == "stages/detect" for c in constants)
        self.seeds = [s for s in range(o.first, o.first + o.cases) if "none" not in reliability.make_case(o.out, s)] if explains else []
        self.sets = [self.make_set(s) for s in range(o.first, o.first + o.sets)] if detects else []

    def make_set(self, seed):
        folder = self.o.out / "sets" / str(seed)
        if not (folder / "set.yaml").exists():
            folder.mkdir(parents=True, exist_ok=True)
            robot = TREE / "tests/data/demo_arm.urdf"
            drawn = subprocess.run([sys.executable, HERE.parent / "contacts/paths.py", robot, str(seed), "1", "1", "1", "1"],
                                   check=True, capture_output=True, text=True).stdout
            (folder / "scenario.yaml").write_text(drawn)
            run(self.program, "simulate", folder / "scenario.yaml", "--force", "--out", folder)
        return folder

    def observe(self, factors):
        """What is said with some constants scaled, {id: factor}: by case or set, a dictionary."""
        text = ",".join(f"{i}={f:.6g}" for i, f in sorted(factors.items()))
        kept = self.o.out / "runs" / f"{self.build}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"
        seen = json.loads(kept.read_text()) if kept.exists() else {}
        only = {self.constants[i].crate for i in factors}
        for seed in self.seeds if only != {"stages/detect"} else []:
            seen.setdefault(f"case {seed}", None) or seen.update({f"case {seed}": self.explained(seed, text)})
        for folder in self.sets if not only or "explain" not in only or len(only) > 1 else []:
            key = f"set {folder.name}"
            seen.setdefault(key, None) or seen.update({key: self.evaluated(folder, text)})
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps(seen))
        return seen

    def explained(self, seed, text):
        answer = json.loads((self.o.out / "answers" / f"{seed:05d}.json").read_text())
        folder = self.o.out / "now"
        try:
            run(self.program, "explain", self.o.out / "cases" / f"c{seed:05d}" / "case.yaml", "--force", "--out", folder, TAUSCOPE_VARY=text)
        except subprocess.CalledProcessError as error:
            return {"failed": error.returncode}
        report = json.loads((folder / "report.json").read_text())
        robot = Robot(self.o.out / "robots" / f"{answer['robot']}.urdf")
        hit, missed, wrong = judge.counts(report["findings"], answer["effects"], robot)
        noise = [x or 1. for x in report["noise_floor"]]
        after = sum((a / n)**2 for a, n in zip(report["holdout_rms_after"], noise) if a is not None)**0.5
        said = sorted({f"{f['effect']} {f['joint'] or f['link'] or ''}".strip() for f in report["findings"]})
        return {"said": said, "hit": hit, "missed": missed, "wrong": wrong, "after": after}

    def evaluated(self, folder, text):
        command = [self.program, "evaluate", folder / "set.yaml", "--force", "--out", self.o.out / "now", "--detectors", "tauscope", "--json"]
        done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "TAUSCOPE_VARY": text})
        if done.returncode:
            return {"failed": done.returncode}
        result = json.loads(done.stdout)["detectors"][0]["seeds"][0]
        return {"found": result["found"], "false": result["false_alarms"], "links": result["link_exact"], "f1": result["samples"]["f1"]}


def changes(usual, seen):
    """What differs, in words; nothing where no answer does."""
    lines, total = [], {"usual": [0, 0, 0], "seen": [0, 0, 0]}
    for key in seen:
        a, b = usual[key], seen[key]
        if "failed" in b or "failed" in a:
            lines += [f"{key}: {a.get('failed', 'done')} -> {b.get('failed', 'done')}"] if a != b else []
        elif "said" in a:
            for name, x in (("usual", a), ("seen", b)):
                total[name] = [t + x[k] for t, k in zip(total[name], ("hit", "missed", "wrong"))]
            gone, new = sorted(set(a["said"]) - set(b["said"])), sorted(set(b["said"]) - set(a["said"]))
            error = b["after"] / max(a["after"], 1e-9) - 1.
            if gone or new or abs(error) > HOLDOUT:
                lines.append(f"{key}: {' '.join([*('-' + x for x in gone), *('+' + x for x in new)])} hold-out {100 * error:+.0f} %")
        elif [a[k] for k in ("found", "false")] != [b[k] for k in ("found", "false")]:
            lines.append(f"{key}: found {a['found']} -> {b['found']}, false alarms {a['false']} -> {b['false']}, F1 {a['f1']:.3f} -> {b['f1']:.3f}")
    f1 = lambda t: 2 * t[0] / max(2 * t[0] + t[1] + t[2], 1)
    if lines and total["usual"] != total["seen"]:
        lines.append(f"F1 of names and places {f1(total['usual']):.3f} -> {f1(total['seen']):.3f}")
    return lines


def one_at_a_time(lab, usual, ids, by):
    flat = 0
    for i in ids:
        for factor in (1. - by, 1. + by):
            found = changes(usual, lab.observe({i: factor}))
            flat += not found
            print(f"{lab.constants[i]} x {factor:.2f}: {'; '.join(found) or 'nothing changes'}", flush=True)
    print(f"\n{flat} of {2 * len(ids)} variations change nothing")


def screen(lab, usual, factors, depth=0):
    """Varies a group at once; halves it while something changes. Returns those that change something alone, with what."""
    found = changes(usual, lab.observe(factors))
    print(f"{'  ' * depth}{len(factors)} at once: {len(found)} changes", flush=True)
    if not found:
        return {}
    if len(factors) == 1:
        (i, factor), = factors.items()
        print(f"{'  ' * depth}{lab.constants[i]} x {factor:.2f}: {'; '.join(found)}", flush=True)
        return {(i, factor): found}
    ids = list(factors)
    halves = [ids[:len(ids) // 2], ids[len(ids) // 2:]]
    return {k: v for half in halves for k, v in screen(lab, usual, {i: factors[i] for i in half}, depth + 1).items()}


def main():
    o = options()
    o.out = o.out.resolve()
    constants = vary_source.find(TREE, o.only, o.crates.split(","))
    if o.list:
        for c in constants:
            print(f"{c.crate} {c} = {c.value}: {c.tuned}")
        print(f"{len(constants)} constants")
        return
    # The build holds all of them, so that another choice needs no other build.
    everything = vary_source.find(TREE)
    target = (o.target or o.out / "target").resolve()
    program = vary_source.build(TREE, o.out / "tree", target, everything, print)
    for c in everything:
        if c.uses <= 0:
            print(f"cannot be varied without a build of its own: {c}")
    ids = [i for i, c in enumerate(everything) if any((c.file, c.name) == (x.file, x.name) for x in constants) and c.uses > 0]
    draw = random.Random(o.seed)
    ids = sorted(draw.sample(ids, min(o.sample, len(ids)))) if o.sample else ids
    print(f"{len(ids)} of {len(everything)} constants are varied", flush=True)
    lab = Lab(o, program, everything)
    usual = lab.observe({})
    if not o.groups:
        one_at_a_time(lab, usual, ids, o.by)
        return
    signs = {i: draw.choice((-1., 1.)) for i in ids}
    draw.shuffle(ids)
    for way in (1., -1.):
        for crate in o.crates.split(","):
            own = {i: 1. + way * signs[i] * o.by for i in ids if everything[i].crate == crate}
            print(f"{crate}, {'as drawn' if way > 0 else 'the other way'}:")
            alone = screen(lab, usual, own) if own else {}
            print(f"{len(alone)} of {len(own)} change something alone\n", flush=True)


if __name__ == "__main__":
    main()
