#!/bin/sh
# Says what got slower from one commit to another: both replay the same recording, in turn, and the instructions of the
# user's code are counted where `perf` can count them, the time where it cannot.
#
#     benches/compare.sh A B [ROUNDS]
set -eu
cd "$(dirname "$0")/.."
a=$1 b=$2 rounds=${3:-5}
folder=$(mktemp -d)
trap 'git worktree remove --force "$folder/a" 2>/dev/null || true
      git worktree remove --force "$folder/b" 2>/dev/null || true
      rm -rf "$folder"' EXIT
for side in a b; do
    eval commit=\$$side
    git worktree add --quiet --detach "$folder/$side" "$commit"
    # One target folder for both: what the two have in common is built once.
    (cd "$folder/$side" && cargo build --quiet --release --locked --target-dir "$folder/target")
    cp "$folder/target/release/tauscope" "$folder/tauscope-$side"
done
cat >"$folder/scenario.yaml" <<END
version: 1
name: compare
robot: $PWD/tests/data/demo_arm.urdf
rate_hz: 1000
recordings:
  - name: loop
    duration_s: 60
    motion: {fourier: {period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}
END
cat >"$folder/pipeline.yaml" <<END
version: 1
cells: {c: {robot: $PWD/tests/data/demo_arm.urdf}}
stages:
- {name: in, cell: c, ingest: {file: {path: loop.mcap}}}
- {name: twin, input: in, twin: {}}
- {name: detect, input: twin, detect: {twin_regression: {}, threshold: {score: 1000}}}
END
cd "$folder"
./tauscope-b simulate scenario.yaml --out . >simulated.log 2>&1
python3 - "$rounds" "$a" "$b" <<'END'
import os, re, subprocess, sys, time

rounds, names = int(sys.argv[1]), sys.argv[2:]
arguments = ["replay", "--pipeline", "pipeline.yaml", "loop.mcap"]
counts = subprocess.run(["perf", "stat", "-e", "instructions:u", "true"], capture_output=True, text=True)
counts = counts.returncode == 0 and "not supported" not in counts.stderr


def once(program):
    """User and system time of a run [s], and its instructions."""
    command = [program, *arguments]
    if counts:
        command = ["perf", "stat", "-x,", "-e", "instructions:u", "-o", "perf.txt", *command]
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    found = re.search(r"(?m)^(\d+),", open("perf.txt").read()) if counts else None
    took = after.children_user + after.children_system - before.children_user - before.children_system
    return took, int(found[1]) if found else 0


best = [[float("inf")] * 2 for _ in names]
for _ in range(rounds):
    for place, program in enumerate(["./tauscope-a", "./tauscope-b"]):
        best[place] = [min(pair) for pair in zip(best[place], once(program))]
for what, place, unit in [("computing time", 0, "s"), ("instructions", 1, "")]:
    one, two = best[0][place], best[1][place]
    if one and two:
        word = "slower" if two > 1.02 * one else "faster" if two < 0.98 * one else "the same within 2 %"
        print(f"{what}: {names[0]} {one:.4g} {unit}, {names[1]} {two:.4g} {unit}, ratio {two / one:.3f}: {word}")
END
