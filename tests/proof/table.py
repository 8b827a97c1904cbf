"""The table of docs/proof.md: what was concealed, what was said, the error before and after on the hold-out, rivals.

    python table.py set/answers.json REPORTS        REPORTS: folder of <case>/report.json

Right: the name and the place of every concealed effect, and nothing else. Class: only with the rivals that the report says
it cannot tell apart. Standard library only.
"""
import json
import math
import pathlib
import sys


def place(effect):
    """The joint or link an effect is in; effects of the whole arm have none."""
    whole = effect["effect"] in ("torque_delay", "torque_lowpass", "base_tilt")
    return None if whole else effect.get("joint") or effect.get("link")


def names(effects):
    return {(effect["effect"], place(effect)) for effect in effects}


def verdict(truth, report):
    """`right`, `class`, or what is missing and what is wrong."""
    said = [f for f in report["findings"] if f["confidence"] >= 0.5]
    wanted = names(truth)
    got = names(said)
    missing, wrong = wanted - got, got - wanted
    if not missing and not wrong:
        return "right"
    for finding in said:
        if (finding["effect"], place(finding)) in wrong:
            ties = names(finding["equivalent_to"][:3]) & missing
            if ties:
                missing -= {next(iter(ties))}
                wrong.discard((finding["effect"], place(finding)))
    if not missing and not wrong:
        return "class"
    text = lambda pairs: ", ".join(f"{e} {p or ''}".strip() for e, p in sorted(pairs, key=str)) or "none"
    return f"missing: {text(missing)}; wrong: {text(wrong)}"


def rms(values):
    """Over joints, of what is given."""
    values = [v for v in values or [] if v is not None]
    return math.sqrt(sum(v * v for v in values)) if values else float("nan")


def parameters(effect):
    skip = ("source_joint", "mode", "against", "by_direction", "kind")
    shown = {k: v for k, v in effect["parameters"].items() if k not in skip and isinstance(v, (int, float))}
    return ", ".join(f"{k} {v:.3g}" for k, v in list(shown.items())[:4])


def row(case, report):
    truth = "; ".join(f"{e['effect']} {place(e) or ''} ({parameters(e)})" for e in case["effects"]) or "nothing"
    said = "; ".join(f"{f['effect']} {place(f) or ''} ({parameters(f)})" for f in report["findings"]) or report["verdict"]
    rivals = "; ".join(
        ", ".join(r["effect"] for r in f["equivalent_to"][:3]) for f in report["findings"] if f["equivalent_to"]
    )
    before, after = rms(report["holdout_rms_before"]), rms(report["holdout_rms_after"])
    noise = rms(report["noise_floor"])
    return f"| {case['case']} | {case['robot']} | {truth} | {said} | {verdict(case['effects'], report)} | {before:.3g} | {after:.3g} | {noise:.3g} | {rivals} |"


def main():
    answers = json.loads(pathlib.Path(sys.argv[1]).read_text())["cases"]
    reports = pathlib.Path(sys.argv[2])
    print("| case | robot | concealed | said | | before | after | noise | cannot be told apart from |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    marks = []
    for case in answers:
        report = json.loads((reports / case["case"] / "report.json").read_text())
        print(row(case, report))
        marks.append(verdict(case["effects"], report))
    right, classes = marks.count("right"), marks.count("class")
    print(f"\n{len(marks)} cases: {right} right, {classes} right up to a class that the report names, {len(marks) - right - classes} not.")


if __name__ == "__main__":
    main()
