"""Measures everything that docs/performance.md tells, and writes its tables.

    python3 benches/performance.py [--only replay,chain] [--docs docs/performance.md]

It builds the release program and the benchmarks, runs each, and puts what they print between the marks of the document
(`<!-- figures: NAME -->` to `<!-- end -->`); the words around them are left alone. A part that fails leaves a visible
line in its place. Without other work on the machine it takes about half an hour, builds aside.
"""

import argparse
import os
import pathlib
import platform
import re
import shlex
import subprocess
import sys
import textwrap
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BENCH = "cargo bench --quiet --locked --profile release"
# By name: the command, and how its output becomes Markdown.
PARTS = {
    "replay": (f"{BENCH} --bench replay", "table"),
    "chain": (f"{BENCH} --bench chain", "text"),
    "detectors": (f"{BENCH} -p tauscope-detect --bench light_detectors", "text"),
    "cells": ("python3 benches/cells.py target/release/tauscope 50 100 150 --processes one", "table"),
    "apart": ("python3 benches/cells.py target/release/tauscope 50 --processes cell", "table"),
    "links": (f"{BENCH} -p tauscope-bus --bench link_latency", "text"),
    "live": (f"{BENCH} --bench live", "table"),
    "commands": ("python3 benches/commands.py target/release/tauscope", "table"),
}
# What stands in a folder of its own may need what is not there.
OUTSIDE = {"pinocchio": ("benches/pinocchio/run.sh", "table"), "dora": ("benches/dora/run.sh", "table")}


def machine():
    """One paragraph: on what, under which load, at which commit."""
    cpu = re.search(r"model name\s*:\s*(.+)", pathlib.Path("/proc/cpuinfo").read_text())
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    rust = subprocess.run(["rustc", "--version"], capture_output=True, text=True).stdout
    load = os.getloadavg()[0]
    return (
        f"Commit {commit.strip()}, {rust.strip()}, {os.cpu_count()} cores ({cpu[1] if cpu else platform.machine()}),\n"
        f"Linux {platform.release().split('-')[0]}, load before the first run {load:.1f}, {time.strftime('%Y-%m-%d', time.gmtime())}."
    )


def measured(command, kind):
    """Runs a command and gives its output as Markdown."""
    begin = time.monotonic()
    done = subprocess.run(shlex.split(command), cwd=ROOT, capture_output=True, text=True)
    took = f"`{command}`, {time.monotonic() - begin:.0f} s, load {os.getloadavg()[0]:.1f}:"
    if done.returncode != 0:
        why = (done.stderr.strip().splitlines() or ["no word of why"])[-1]
        print(done.stderr, file=sys.stderr)
        return textwrap.fill(f"Not measured: `{command}` ended with {done.returncode}: {why}", 120)
    output = done.stdout.strip()
    if kind == "text":
        return f"{took}\n\n```text\n{output}\n```"
    # A table needs an empty line before it.
    return f"{took}\n\n" + re.sub(r"(?m)^([^|\n].*)\n\|", r"\1\n\n|", output)


def put(text, name, figures):
    """`text` with `figures` between the marks of `name`."""
    marks = re.compile(rf"(<!-- figures: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not marks.search(text):
        sys.exit(f"the document has no `<!-- figures: {name} -->` … `<!-- end -->`")
    return marks.sub(lambda found: f"{found[1]}\n{figures}\n\n{found[2]}", text)


def main():
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="of the parts, separated by commas: " + ", ".join(PARTS | OUTSIDE))
    parser.add_argument("--docs", type=pathlib.Path, default=ROOT / "docs" / "performance.md")
    args = parser.parse_args()
    only = [name for name in args.only.split(",") if name]
    parts = dict(PARTS)
    for name, (command, kind) in OUTSIDE.items():
        if (ROOT / command).exists():
            parts[name] = (command, kind)
        else:
            print(f"{name}: skipped, there is no {command}", file=sys.stderr)
    if unknown := set(only) - set(PARTS | OUTSIDE):
        sys.exit(f"no such part: {', '.join(sorted(unknown))}")
    print("machine", file=sys.stderr)
    found = {"machine": machine()}
    subprocess.run(["cargo", "build", "--release", "--locked", "--quiet"], cwd=ROOT, check=True)
    for name, (command, kind) in parts.items():
        if not only or name in only:
            print(f"{name}: {command}", file=sys.stderr)
            found[name] = measured(command, kind)
    text = args.docs.read_text()
    for name, figures in found.items():
        text = put(text, name, figures)
    args.docs.write_text(text)


if __name__ == "__main__":
    main()
