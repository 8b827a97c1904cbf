"""Two programs, or one with two sets of options, on the same recordings in one run, case by case.

    python beside.py SET OUT "PROGRAM [OPTION...]" "PROGRAM [OPTION...]"

For example: python beside.py tests/proof/set out/beside ../before/target/debug/tauscope target/debug/tauscope
SET holds answers.json and cases/; OPTIONs go to `explain`. Printed of each case: what table.py says of the findings, how
many 95 % intervals hold the concealed number, the error left on the hold-out as a share, and the processor time. Then the sums.
Standard library only.
"""
import json
import os
import pathlib
import shlex
import subprocess
import sys

from table import place, rms, verdict


def explained(command, case, out):
    """The report of one program, and its processor time [s]."""
    program, *options = shlex.split(command)
    arguments = [program, "explain", str(case), "--force", "--out", str(out), *options]
    before = os.times()
    subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return json.loads((out / "report.json").read_text()), cpu


def intervals(truth, report):
    """How many 95 % intervals there are for numbers that are known, and how many hold them."""
    known = {(e["effect"], place(e)): e["parameters"] for e in truth}
    given = held = 0
    for finding in report["findings"]:
        numbers = known.get((finding["effect"], place(finding)), {})
        for name, (low, high) in finding["intervals_95"].items():
            if isinstance(numbers.get(name), (int, float)):
                given += 1
                held += low <= numbers[name] <= high
    return given, held


def main():
    folder, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    commands = sys.argv[3:5]
    answers = json.loads((folder / "answers.json").read_text())["cases"]
    print("| case | " + " | ".join(f"{x} findings | {x} held | {x} left | {x} CPU s" for x in "AB") + " |")
    print("| --- |" + " --- |" * 8)
    sums = [{"right": 0, "class": 0, "given": 0, "held": 0, "cpu": 0.0} for _ in commands]
    for case in answers:
        cells = []
        for command, total, side in zip(commands, sums, "AB"):
            source = folder / "cases" / case["case"] / "case.yaml"
            report, cpu = explained(command, source, out / side / case["case"])
            mark = verdict(case["effects"], report)
            given, held = intervals(case["effects"], report)
            left = rms(report["holdout_rms_after"]) / max(rms(report["holdout_rms_before"]), 1e-12)
            total[mark] = total.get(mark, 0) + 1
            total["given"] += given
            total["held"] += held
            total["cpu"] += cpu
            cells.append(f"{mark} | {held} of {given} | {left:.3f} | {cpu:.1f}")
        print(f"| {case['case']} | " + " | ".join(cells) + " |", flush=True)
    for command, total, side in zip(commands, sums, "AB"):
        print(f"\n{side}: `{command}`: {total['right']} of {len(answers)} right, {total['class']} up to a class; "
              f"{total['held']} of {total['given']} intervals hold; {total['cpu']:.0f} s of CPU.")


if __name__ == "__main__":
    main()
