"""The table of `run.sh`: `table.py FOLDER ROBOT` reads `ours` and `theirs` there."""
import sys
from pathlib import Path

# Of plain Pinocchio's time, and of its generated code's.
GOALS = (0.35, 1.0)


def fastest(path):
    times, sums = {}, {}
    for line in Path(path).read_text().splitlines():
        name, ns, total = line.split()
        times[name] = min(float(ns), times.get(name, float("inf")))
        sums[name] = float(total)
    return times, sums


folder, robot = Path(sys.argv[1]), sys.argv[2]
ours, our_sums = fastest(folder / "ours")
theirs, their_sums = fastest(folder / "theirs")
print(f"\n| {robot}, ns per call | ours | Pinocchio | ratio (goal {GOALS[0]}) | its generated code | ratio (goal {GOALS[1]:.0f}) |")
print("| --- | ---: | ---: | ---: | ---: | ---: |")
wrong = []
for name, ns in ours.items():
    for other in (name, f"generated_{name}"):
        if abs(their_sums[other] - our_sums[name]) > 1e-6 * our_sums[name]:
            wrong.append(f"{robot}: {other} answers {their_sums[other]}, ours {our_sums[name]}")
    plain, generated = theirs[name], theirs[f"generated_{name}"]
    label = name.replace("_", " ").replace("rnea", "RNEA")
    print(f"| {label} | {ns:.0f} | {plain:.0f} | {ns / plain:.2f} | {generated:.0f} | {ns / generated:.2f} |")
if wrong:
    sys.exit("\n".join(wrong))
