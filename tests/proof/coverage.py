"""How often an interval holds the truth: the simulated cell conceals, `explain` tells, and both are compared, parameter by parameter.

    python coverage.py TAUSCOPE OUT [--cases 250] [--count 2] [--first 1] [--scenario FILE] [--slow 0.7] [--bodies-off] [--table]

Counted are the numbers of effects that were named at the right place; the rest, and what was missed, is counted apart. --slow makes that share of
the effort's noise slow (0.3 s), with the same variance. --bodies-off gives `explain` a URDF with every mass 5 % and every centre of mass 5 mm off;
bodies are then not counted, because what is right for them is not known. --table prints one row of Markdown instead of every number.
"""
import argparse
import collections
import concurrent.futures
import json
import math
import pathlib
import re
import subprocess

import numpy as np

import make
import record

HERE = pathlib.Path(__file__).resolve().parent
WRAPS = {"phase_rad", "phase2_rad"}


def options():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("tauscope")
    a.add_argument("out", type=pathlib.Path)
    a.add_argument("--cases", type=int, default=250)
    a.add_argument("--count", type=int, default=2, help="effects in a case")
    a.add_argument("--first", type=int, default=1, help="seed of the first case")
    a.add_argument("--slow", type=float, default=0., help="share of the noise that is slow")
    a.add_argument("--bodies-off", action="store_true")
    a.add_argument("--table", action="store_true")
    a.add_argument("--scenario", type=pathlib.Path, default=HERE.parent / "data/concealed.scenario.yaml")
    return a.parse_args()


def run(o, seed):
    """What was concealed and what was said, or None where nothing could be concealed."""
    folder = o.out / f"{seed:04d}"
    report, answer = folder / "report" / "report.json", folder / "concealed.json"
    if not report.exists():
        folder.mkdir(parents=True, exist_ok=True)
        text = o.scenario.read_text()
        text = re.sub(r"^robot: .*$", f"robot: {o.scenario.resolve().parent / 'demo_arm.urdf'}", text, flags=re.M)
        text = re.sub(r"^seed: .*$", f"seed: {seed}", text, flags=re.M)
        text = re.sub(r"^conceal: .*$", f"conceal: {{seed: {seed}, count: {o.count}}}", text, flags=re.M)
        scenario = folder / "scenario.yaml"
        scenario.write_text(text)
        if o.slow:
            text = re.sub(r"effort_noise_of_limit: ([0-9.]+)", lambda m: f"effort_noise_of_limit: {float(m[1]) * math.sqrt(1 - o.slow)}", text)
            scenario.write_text(text)
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        if subprocess.run([o.tauscope, "simulate", scenario, "--force", "--out", folder], **quiet).returncode:
            return None
        spoil(o, folder, np.random.default_rng(seed))
        subprocess.run([o.tauscope, "explain", folder / "case.yaml", "--force", "--out", folder / "report"], check=True, **quiet)
        for recording in folder.glob("*.mcap"):
            recording.unlink()
    return json.loads(answer.read_text())["effects"], json.loads(report.read_text())["findings"]


def spoil(o, folder, rng):
    """Makes a part of the noise slow and the bodies of the URDF a little wrong."""
    if o.slow:
        urdf = (HERE.parent / "data/demo_arm.urdf").read_text()
        limits = {name: float(x) for name, x in re.findall(r'<joint name="([^"]+)".*?<limit[^>]*effort="([0-9.]+)"', urdf, re.S)}
        of_limit = float(re.search(r"effort_noise_of_limit: ([0-9.]+)", o.scenario.read_text())[1])
        for path in sorted(folder.glob("*.mcap")):
            names, stamps, q, v, tau = record.read(path)
            t = (np.array(stamps) - stamps[0]) * 1e-9
            sigma = of_limit * math.sqrt(o.slow) * np.array([limits[name] for name in names])
            record.write(path, names, stamps, q, v, tau + sigma * make.coloured(rng, t, len(names), 0.3))
    if o.bodies_off:
        case = folder / "case.yaml"
        robot = re.search(r"^robot: *(.*)$", case.read_text(), re.M)[1].strip("\"'")
        wrong = lambda m: f"{m[1]}{float(m[2]) * (1 + 0.05 * rng.normal()):.6g}{m[3]}"
        text = re.sub(r'(<mass value=")([^"]+)(")', wrong, (folder / robot).read_text())
        moved = lambda m: m[1] + " ".join(f"{float(x) + rng.uniform(-0.005, 0.005):.6g}" for x in m[2].split()) + m[3]
        text = re.sub(r'(<inertial>\s*<origin xyz=")([^"]+)(")', moved, text)
        (folder / "off.urdf").write_text(text)
        case.write_text(re.sub(r"^robot: .*$", "robot: off.urdf", case.read_text(), flags=re.M))


# Those have one place only, or none.
BODIES = {"payload", "payload_pickup", "link_mass", "link_com", "link_inertia", "rotor_inertia", "base_tilt"}
ANYWHERE = {"torque_delay", "torque_lowpass", "base_tilt", "payload", "payload_pickup", "contact_wall"}


def named(effect):
    """Effect and place."""
    # What the list of names lacks is an `unknown` of a kind.
    name = effect["parameters"].get("kind") or effect["effect"]
    where = None if name in ANYWHERE else effect.get("joint") or effect.get("link")
    return name, where


def holds(name, truth, interval):
    low, high = interval
    if name in WRAPS:
        middle = 0.5 * (low + high)
        truth = middle + math.remainder(truth - middle, 2 * math.pi)
    return low <= truth <= high


def worst(hit, of):
    """The effects that most intervals of miss, with how many of how many hold."""
    held, every = collections.Counter(), collections.Counter()
    for (effect, _), count in of.items():
        every[effect] += count
    for (effect, _), count in hit.items():
        held[effect] += count
    missing = sorted(every, key=lambda effect: held[effect] - every[effect])
    return ", ".join(f"{effect} {held[effect]} of {every[effect]}" for effect in missing[:3] if held[effect] < every[effect])


def main():
    o = options()
    hit, of = collections.Counter(), collections.Counter()
    missed, found, wrong, cases = [], 0, 0, 0
    seeds = range(o.first, o.first + o.cases)
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        all_of_them = list(pool.map(lambda seed: run(o, seed), seeds))
    for seed, both in zip(seeds, all_of_them):
        if both is None:
            continue
        concealed, said = both
        if o.bodies_off:
            concealed = [e for e in concealed if e["effect"] not in BODIES]
            said = [f for f in said if f["effect"] not in BODIES and not f.get("link")]
        cases += 1
        for effect in concealed:
            own = [f for f in said if named(f) == named(effect)]
            if not own:
                continue
            found += 1
            for name, interval in own[0]["intervals_95"].items():
                truth = effect["parameters"].get(name)
                # A push is told in its recording's time.
                if not isinstance(truth, (int, float)) or effect["effect"] == "external_push" and name.startswith("t_"):
                    continue
                key = (effect["effect"], name)
                of[key] += 1
                if holds(name, truth, interval):
                    hit[key] += 1
                else:
                    missed.append((seed, *key, truth, interval))
        names = {named(e) for e in concealed}
        wrong += sum(named(f) not in names for f in said)
    total, held = sum(of.values()), sum(hit.values())
    share = held / max(total, 1)
    half = 1.96 * math.sqrt(share * (1 - share) / max(total, 1))
    if o.table:
        print("| cells | effects named | findings of nothing concealed | intervals | hold the truth | share | worst effects |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        print(f"| {cases} | {found} | {wrong} | {total} | {held} | {100 * share:.1f} ± {100 * half:.1f} % | {worst(hit, of)} |")
        return
    for key in sorted(of):
        print(f"{key[0]:26}{key[1]:34}{hit[key]:5} of {of[key]:4}  {hit[key] / of[key]:.2f}")
    for seed, effect, name, truth, (low, high) in missed:
        print(f"missed by {seed}: {effect} {name} {truth:.5g}, said {low:.5g} to {high:.5g}")
    print(f"{cases} cases of {o.count} effects: {found} named, {wrong} findings that were not concealed")
    print(f"{held} of {total} intervals hold the truth: {100 * share:.1f} % (+- {100 * half:.1f})")


if __name__ == "__main__":
    main()
