#!/usr/bin/env python3
"""Runs the trials and judges the answers; `run.sh` starts it.

    python3 run.py --program TAUSCOPE --work DIR [--short] [--only NAME] [--jobs N] [--table FILE]

Inputs are generated once into DIR/inputs. The outputs of a run, and what the program printed, are in DIR/runs. Prints
a row for each command. Exit code 1 if an answer is bad.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import cases  # noqa: E402
from lib.session import session  # noqa: E402

LIMIT_S = 900
STAMP_FILE = ".generated"


def sources():
    """A hash of everything that decides what the inputs are."""
    digest = hashlib.sha256()
    for path in sorted([*HERE.glob("lib/*.py"), *HERE.glob("cases/*.py")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def generate(folder, make, version):
    """Writes the inputs into `folder`, unless this version of them is there."""
    stamp = folder / STAMP_FILE
    if stamp.exists() and stamp.read_text() == version:
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    make(folder)
    stamp.write_text(version)


def call(program, command, folder):
    """Runs the program; exit code, output of both streams, seconds."""
    begin = time.monotonic()
    try:
        done = subprocess.run(
            ["nice", str(program), *command.split()],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=LIMIT_S,
            env={**os.environ, "NO_COLOR": "1"},
        )
        code, output = done.returncode, done.stdout.decode(errors="replace")
    except subprocess.TimeoutExpired:
        code, output = "none", f"stopped after {LIMIT_S} s"
    return code, output, time.monotonic() - begin


def fresh(inputs, folder):
    """An empty folder that refers to the inputs."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for path in inputs.iterdir():
        if path.name != STAMP_FILE:
            (folder / path.name).symlink_to(path)


class Runner:
    def __init__(self, program, work, short):
        self.program, self.work, self.short = program, work, short
        self.version = sources()
        self.rows, self.lock = [], threading.Lock()

    def sound_cell(self):
        """The pipeline file of the sound arm, with which bad recordings are replayed."""
        inputs, folder = self.work / "inputs" / "cell", self.work / "runs" / "cell"
        generate(inputs, session(), self.version)
        fresh(inputs, folder)
        free = " ".join(f"free_{n}.mcap" for n in range(1, 6))
        code, output, _ = call(self.program, f"init {free} --robot arm.urdf --effort-unit Nm --out cell", folder)
        if code != 0:
            sys.exit(f"init fails on sound recordings, exit code {code}:\n{output}")
        return folder / "cell" / "pipeline.yaml"

    def trial(self, trial, cell):
        inputs, folder = self.work / "inputs" / trial.name, self.work / "runs" / trial.name
        generate(inputs, trial.make, self.version)
        fresh(inputs, folder)
        for number, run in enumerate(trial.runs):
            if self.short and not run.short:
                continue
            code, output, seconds = call(self.program, trial.command(run, cell), folder)
            (folder / f"{number}-{run.command.split()[0]}.txt").write_text(f"exit code {code}\n{output}")
            faults = run.judge(code, output, folder)
            with self.lock:
                self.rows.append((trial.name, run.command, code, seconds, faults))
                print(row(*self.rows[-1]), flush=True)
            # Later commands would fill the disk with results of no use.
            for made in folder.glob("results*"):
                shutil.rmtree(made, ignore_errors=True)


# Answers that fall short of what was decided to be good, by trial, with the reason. They count apart.
MISSED = {
    "stamp-negative": "stamps before 1970 are refused with that reason; the time of recording could replace them",
    "report-zenoh-bridge-copies": "messages out of order are refused, and at half the rate the detector cannot judge",
}


def row(name, command, code, seconds, faults):
    shown = command.replace(" --robot arm.urdf", "").replace(" --pipeline {cell}", "")
    shown = re.sub(r" --out \S+", "", shown)
    why = "; ".join(faults).replace("|", "\\|")
    answer = "GOOD" if not faults else "MISS" if name in MISSED else "BAD"
    return f"| {name} | `{shown}` | {code} | {seconds:.0f} | {answer} | {why} |"


def logged():
    """The names of the trials in the log, README.md."""
    return set(re.findall(r"^\| `([a-z0-9-]+)` \|", (HERE / "README.md").read_text(), re.M))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--program", type=Path, required=True)
    arguments.add_argument("--work", type=Path, required=True)
    arguments.add_argument("--short", action="store_true", help="only the quick commands")
    arguments.add_argument("--only", default=".", help="only trials whose name matches this regular expression")
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--table", type=Path, help="a file that gets the table, too")
    arguments = arguments.parse_args()

    unlogged = {trial.name for trial in cases.ALL} ^ logged()
    if unlogged:
        sys.exit(f"README.md and the trials differ in: {', '.join(sorted(unlogged))}")
    chosen = [trial for trial in cases.ALL if re.search(arguments.only, trial.name)]
    if not chosen:
        sys.exit(f"no trial is called {arguments.only}")
    runner = Runner(arguments.program.resolve(), arguments.work.resolve(), arguments.short)
    cell = runner.sound_cell()
    head = "| trial | command | exit | s | answer | why |\n| --- | --- | ---: | ---: | --- | --- |"
    print(head, flush=True)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        for done in [pool.submit(runner.trial, trial, cell) for trial in chosen]:
            done.result()
    if arguments.table:
        order = {trial.name: number for number, trial in enumerate(cases.ALL)}
        rows = sorted(runner.rows, key=lambda entry: order[entry[0]])
        arguments.table.write_text("\n".join([head, *(row(*entry) for entry in rows)]) + "\n")
    faulty = [entry for entry in runner.rows if entry[4]]
    bad = [entry for entry in faulty if entry[0] not in MISSED]
    trials, missed = {entry[0] for entry in bad}, len(faulty) - len(bad)
    print(
        f"\n{len(runner.rows)} answers, {len(bad)} bad, {missed} missed; "
        f"{len(chosen)} trials, {len(trials)} with a bad answer"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
