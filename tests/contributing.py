#!/usr/bin/env python3
"""Follows CONTRIBUTING.md literally, in a copy of the tree.

    python3 tests/contributing.py [--keep] [--only detector|term|source|kind|stage]

Each worked example must build, work in a run, and touch exactly the files that it names. The copy stands in
target/contributing, and its builds go to the tree's own target folder, so that dependencies are not built again.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
EXAMPLES = {
    "detector": "### Adding a detector",
    "term": "### Adding a physics term",
    "source": "### Adding a source",
    "kind": "### Adding a kind of stage",
    "stage": "### Adding an external stage",
}
BLOCK = re.compile(r"^`([^`\n]+)`(, edit)?\n\n```\w+\n(.*?)^```$", re.S | re.M)
SHELL = re.compile(r"^```sh\n(.*?)^```$", re.S | re.M)


def section(text, heading):
    """The text below a heading, up to the next one of its level or above."""
    start = text.index(heading + "\n")
    rest = text[start + len(heading) :]
    end = re.search(r"^#{2,3} ", rest, re.M)
    return rest[: end.start()] if end else rest


def edit(path, block):
    """Replaces the lines of `block` with ` ` or `-` by those with ` ` or `+`; they must stand there once."""
    lines = [line for line in block.split("\n") if line]
    old = "".join(line[1:] + "\n" for line in lines if line[0] in " -")
    new = "".join(line[1:] + "\n" for line in lines if line[0] in " +")
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if ("\n" + text).count("\n" + old) != 1:
        sys.exit(f"{path}: the lines of this edit do not stand there once:\n{block}")
    place = ("\n" + text).index("\n" + old)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text[:place] + new + text[place + len(old) :])


def apply(tree, example):
    """Applies the blocks of an example; the files that they name."""
    named = set()
    for name, edited, block in BLOCK.findall(example):
        path = os.path.join(tree, name)
        if edited:
            edit(path, block)
        else:
            if os.path.exists(path):
                sys.exit(f"{name} is there already")
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8") as file:
                file.write(block)
        named.add(name)
    return named


def run(tree, *command, code=0):
    """Runs a command in the copy; its standard output."""
    variables = {**os.environ, "CARGO_TARGET_DIR": os.path.join(ROOT, "target")}
    done = subprocess.run(command, cwd=tree, env=variables, capture_output=True, text=True, check=False)
    if done.returncode != code:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def write(tree, name, text):
    with open(os.path.join(tree, name), "w", encoding="utf-8") as file:
        file.write(text)


def expect(holds, what):
    if not holds:
        sys.exit(f"not so: {what}")
    print(f"  {what}")


PIPELINE = """version: 1
cells: {{demo: {{robot: tests/data/demo_arm.urdf}}}}
stages:
  - {{name: ingest, ingest: {source}}}
  - {{name: twin, input: ingest, twin: {{model: tests/data/demo.twin.yaml}}}}
{more}  - {{name: record, inputs: [ingest, twin{inputs}], record: {{mcap: "out/example-{{n}}.mcap"}}}}
"""
DEMO = "{file: {path: tests/data/demo.mcap}, rate: fast}"


def detector(tree, tauscope):
    expect('"cusum"' in run(tree, tauscope, "schema"), "the schema has the detector `cusum`")
    more = "  - {name: cusum, input: twin, detect: {cusum: {}, threshold: {score: 0.3}}}\n"
    write(tree, "out/cusum.yaml", PIPELINE.format(source=DEMO, more=more, inputs=", cusum").replace("tests/", "../tests/"))
    said = run(tree, tauscope, "replay", "--json", "--pipeline", "out/cusum.yaml", "tests/data/demo.mcap", "--out", "out/r")
    events = json.loads(said)[0]["detectors"][0]["events"]
    with open(os.path.join(tree, "tests/data/labels.json"), encoding="utf-8") as file:
        labels = json.load(file)["recordings"]["demo"]["events"]
    found = [l for l in labels if any(l["t_on"] <= e["t"] <= l["t_off"] + 0.15 for e in events)]
    expect(found, f"it finds {len(found)} of {len(labels)} contacts of the demo, with {len(events)} alarms")


SCENARIO = """version: 1
name: brake
robot: demo_arm.urdf
seed: 5
rate_hz: 100
physics:
  - {effect: eddy_current_drag, joint: joint2, parameters: {peak_torque_nm: 6.0, peak_speed_rad_s: 0.2}}
conceal: {seed: 1, count: 0}
sensors: {position_noise_rad: 0.00001, velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}
recordings:
"""
MOTION = "  - {{name: sweep_{}, duration_s: 8, motion: {{fourier: {{period_s: 8, harmonics: 5, speed: {}, acceleration_rad_s2: 5, range: 0.6}}}}}}\n"


def term(tree, tauscope):
    run(tree, "cargo", "test", "--quiet", "--offline", "-p", "tauscope-dynamics", "--lib", "terms")
    print("  it passes the tests of all effects")
    scenario = SCENARIO + "".join(MOTION.format(i, 0.4 + 0.1 * i) for i in range(6))
    shutil.copy(os.path.join(tree, "tests/data/demo_arm.urdf"), os.path.join(tree, "out"))
    write(tree, "out/brake.scenario.yaml", scenario)
    run(tree, tauscope, "simulate", "out/brake.scenario.yaml", "--out", "out/brake")
    run(tree, tauscope, "explain", "out/brake/case.yaml", "--out", "out/brake/report")
    with open(os.path.join(tree, "out/brake/report/report.json"), encoding="utf-8") as file:
        findings = json.load(file)["findings"]
    named = [f for f in findings if f["effect"] == "eddy_current_drag" and f["joint"] == "joint2"]
    expect(named, f"it is found in a simulated arm, among {len(findings)} findings")
    expect("eddy-current drag of" in named[0]["sentence"], f"the report says: {named[0]['sentence']}")
    with open(os.path.join(tree, "out/brake/report/report.html"), encoding="utf-8") as file:
        expect("currents that a magnet induces" in file.read(), "the page says what it means at the arm")
    torque = named[0]["parameters"]["peak_torque_nm"]
    expect(abs(torque - 6.0) < 0.6, f"its torque is {torque:.2f} N m, simulated with 6")


def source(tree, tauscope):
    text = PIPELINE.format(source="{constant: {samples: 500, rate_hz: 100}}", more="", inputs="")
    write(tree, "constant.yaml", text)
    said = json.loads(run(tree, tauscope, "run", "--json", "constant.yaml"))
    os.remove(os.path.join(tree, "constant.yaml"))
    made = {stage["stage"]: stage["emitted"] for stage in said["stages"]}
    expect(made["ingest"] == 500 and made["twin"] == 500, "500 samples go through a pipeline")


def kind(tree, tauscope):
    run(tree, "cargo", "test", "--quiet", "--offline", "-p", "tauscope-pipeline", "--test", "stages")
    print("  it keeps the promises of all stages")
    more = "  - {name: thin, input: ingest, thin: {every: 4}}\n  - {name: slow, input: thin, twin: {}}\n"
    text = PIPELINE.format(source=DEMO, more=more, inputs=", thin, slow")
    write(tree, "thin.yaml", text)
    said = json.loads(run(tree, tauscope, "run", "--json", "thin.yaml"))
    os.remove(os.path.join(tree, "thin.yaml"))
    made = {stage["stage"]: stage["emitted"] for stage in said["stages"]}
    expect(made["slow"] == made["thin"] == -(-made["ingest"] // 4) > 0, f"a twin gets {made['thin']} of {made['ingest']}")
    write(tree, "out/thin.yaml", text.replace("tests/", "../tests/"))
    said = run(tree, tauscope, "replay", "--json", "--pipeline", "out/thin.yaml", "tests/data/demo.mcap", "--out", "out/t")
    counts = {stage["stage"]: stage["emitted"] for stage in json.loads(said)[0]["stages"]}
    expect(counts["slow"] == made["slow"], "and as many in a replay")


def stage(tree, tauscope):
    more = "  - name: standing\n    input: ingest\n    outside: {command: [COMMAND], output: detection}\n"
    more = more.replace("COMMAND", os.path.join(ROOT, "target/debug/standing-stage"))
    write(tree, "standing.yaml", PIPELINE.format(source=DEMO, more=more, inputs=", standing"))
    said = json.loads(run(tree, tauscope, "run", "--json", "standing.yaml"))
    os.remove(os.path.join(tree, "standing.yaml"))
    made = {stage["stage"]: stage["emitted"] for stage in said["stages"]}
    expect(made["standing"] == made["ingest"] > 0, f"it judges all {made['ingest']} samples of the demo")


def main():
    arguments = argparse.ArgumentParser(description="Follows CONTRIBUTING.md literally, in a copy of the tree.")
    arguments.add_argument("--keep", action="store_true", help="leaves the copy there")
    arguments.add_argument("--only", choices=EXAMPLES, action="append")
    asked = arguments.parse_args()
    with open(os.path.join(ROOT, "CONTRIBUTING.md"), encoding="utf-8") as file:
        text = file.read()
    # Always the same place, so that what is built of it is replaced and not added to.
    tree = os.path.join(ROOT, "target", "contributing")
    shutil.rmtree(tree, ignore_errors=True)
    os.makedirs(tree)
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        if os.path.isfile(os.path.join(ROOT, name)):
            os.makedirs(os.path.dirname(os.path.join(tree, name)), exist_ok=True)
            shutil.copy(os.path.join(ROOT, name), os.path.join(tree, name))
    subprocess.run("git init -q && git add -A", cwd=tree, shell=True, check=True)
    os.makedirs(os.path.join(tree, "out"))
    examples = {name: section(text, EXAMPLES[name]) for name in asked.only or EXAMPLES}
    named = {name: apply(tree, example) for name, example in examples.items()}
    for example in examples.values():
        for script in SHELL.findall(example):
            run(tree, "bash", "-euc", script.replace("--target-dir target", "--offline"))
    run(tree, "cargo", "fmt", "--all")
    run(tree, "cargo", "build", "--offline")
    # The copy's program, kept from the next build of the tree itself.
    tauscope = os.path.join(tree, "out/tauscope")
    shutil.copy2(os.path.join(ROOT, "target/debug/tauscope"), tauscope)
    checks = {"detector": detector, "term": term, "source": source, "kind": kind, "stage": stage}
    for name in examples:
        print(f"{name}:")
        checks[name](tree, tauscope)
    status = subprocess.run(["git", "status", "--porcelain", "-uall"], cwd=tree, capture_output=True, text=True, check=True)
    touched = {line[3:] for line in status.stdout.split("\n") if line and line[1] != " "}
    wanted = set().union(*named.values())
    if "stage" in named:
        wanted.add("examples/standing-stage/Cargo.lock")
    if "kind" in named:
        wanted.add("Cargo.lock")
    expect(touched == wanted, f"{len(touched)} files are touched, those that are named")
    if asked.keep:
        print(tree)
    else:
        shutil.rmtree(tree)


if __name__ == "__main__":
    main()
