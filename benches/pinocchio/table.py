"""The table of `run.sh`: `table.py FOLDER ROBOT` reads `ours` and `theirs` there."""
import sys
from pathlib import Path


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
print(f"\n| {robot} [ns] | ours | batches | Pinocchio (P) | ours / P | batches / P | generated (G) | ours / G | batches / G |")
print("| --- " + "| ---: " * 8 + "|")
wrong = []
for name in (name for name in ours if not name.startswith("batch_")):
    batch, generated = f"batch_{name}", f"generated_{name}"
    for other in (their_sums[name], their_sums[generated], our_sums[batch]):
        if abs(other - our_sums[name]) > 1e-6 * our_sums[name]:
            wrong.append(f"{robot}: {name} answers {our_sums[name]}, another {other}")
    one, four, plain, fast = ours[name], ours[batch], theirs[name], theirs[generated]
    label = name.replace("_", " ").replace("rnea", "RNEA")
    print(f"| {label} | {one:.0f} | {four:.0f} | {plain:.0f} | {one / plain:.2f} | {four / plain:.2f}"
          f" | {fast:.0f} | {one / fast:.2f} | {four / fast:.2f} |")
if wrong:
    sys.exit("\n".join(wrong))
