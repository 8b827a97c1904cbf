"""Makes every figure of docs/proof.md, and writes it between its marks. Long tables go to docs/proof-cases.md.

    python3 tests/proof/all.py [--only committed,coverage] [--out out/all] [--docs docs] [--jobs 2] [--program tauscope]

Needs requirements.txt. Each figure says of which commit it is. What is in `--out` already is not made again, so a part that was stopped goes on where it was.
The whole takes some two hours of two cores, estimated from its parts;
`--only committed,first_sight,first_sight_beside,nulls` took nine minutes beside other work. `--jobs` parts are made at once.
"""
import argparse
import concurrent.futures
import pathlib
import re
import shutil
import subprocess
import sys
import textwrap
import threading

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benches"))
import performance

# By name: the command, in which OUT is the folder of its results. All print Markdown; --table would make nothing.
PARTS = {
    "committed": "tests/proof/prove.sh tests/proof/set OUT PROGRAM",
    "first_sight": "python3 tests/proof/first_sight.py PROGRAM OUT --seed 41",
    "first_sight_beside": "python3 tests/proof/first_sight.py PROGRAM OUT --seed 42 --beside friction,bodies",
    "first_sight_topic": "python3 tests/proof/first_sight.py PROGRAM OUT --seed 43 --twin-topic --nulls 6 "
                         "--kinds 'gear_hums_at_a_speed, hose_round_the_joint, grease_to_be_parted, dent_in_a_race, "
                         "field_weakening, offset_by_heat, contact_is_lost, rubs_now_and_then'",
    "nulls": "python3 tests/proof/first_sight.py PROGRAM OUT --seed 41 --kinds '' --nulls 6",
    "named": "python3 tests/proof/named.py PROGRAM OUT --count 1 --beside friction,bodies",
    "faults": "python3 tests/proof/faults.py PROGRAM OUT --seed 611 --count 12",
    "slips": "python3 tests/proof/slips.py PROGRAM OUT --seed 501 --count 1",
    "changed": "python3 tests/proof/changed.py PROGRAM OUT --seed 21 --count 2",
    "coverage": "python3 tests/proof/coverage.py PROGRAM OUT --cases 40 --count 3 --first 7001 --table",
    "coverage_slow": "python3 tests/proof/coverage.py PROGRAM OUT --cases 40 --count 3 --first 7501 --slow 0.7 --table",
    "coverage_bodies_off": "python3 tests/proof/coverage.py PROGRAM OUT --cases 40 --count 3 --first 7401 --bodies-off --table",
    "reliability": "python3 tests/proof/reliability.py PROGRAM OUT --first 6001 --cases 120 --half odd --svg docs/reliability.svg",
}

# Their tables have a row for each case, which stand in proof-cases.md; proof.md has the sentence below the table.
LONG = ("committed", "named", "faults", "slips", "changed")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="of the parts, separated by commas: " + ", ".join(PARTS))
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/all"))
    parser.add_argument("--docs", type=pathlib.Path, default=ROOT / "docs")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--program", type=pathlib.Path, help="of this commit; without it the release is built")
    args = parser.parse_args()
    only = [name for name in args.only.split(",") if name] or list(PARTS)
    if unknown := set(only) - set(PARTS):
        sys.exit(f"no such part: {', '.join(sorted(unknown))}")
    # What was measured for an hour must not be lost for want of a page.
    for page in ("proof.md", "proof-cases.md"):
        if not (args.docs / page).is_file():
            sys.exit(f"no such page: {args.docs / page}")
    built = args.program or ROOT / "target/release/tauscope"
    if not args.program:
        subprocess.run(["cargo", "build", "--release", "--locked", "--quiet"], cwd=ROOT, check=True)
    # A copy, so that the next build may begin before the last part has ended.
    program = args.out / "tauscope"
    program.parent.mkdir(parents=True, exist_ok=True)
    program.unlink(missing_ok=True)
    shutil.copy2(built, program)
    describe = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(describe, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    written = threading.Lock()

    def make(name):
        command = PARTS[name].replace("PROGRAM", str(program)).replace("OUT", str(args.out / name))
        print(f"{name}: {command}", file=sys.stderr)
        figures = finished(performance.measured(command, "table"))
        # Anybody's program is where cargo puts it.
        figures = figures.replace(str(program), "target/release/tauscope").replace(":\n", f", commit {commit}:\n", 1)
        figures = wrapped(figures)
        with written:
            if name in LONG:
                put(args.docs / "proof-cases.md", name, figures)
                figures = "\n\n".join(x for x in re.split(r"\n\n+", figures) if not x.startswith("|"))
            put(args.docs / "proof.md", name, figures)

    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        # What a part raises is raised here.
        list(pool.map(make, only))


def put(document, name, figures):
    document.write_text(performance.put(document.read_text(), name, figures))


def finished(markdown):
    """Figures without the lines that tell how far a run is, which come before the first table."""
    head, table, rest = markdown.partition("\n|")
    return head.split("\n")[0] + "\n\n" + (table + rest).lstrip() if table else markdown


def wrapped(markdown):
    """Sentences in lines of at most 120 characters; rows of tables stay as they are."""
    fill = textwrap.TextWrapper(120, break_long_words=False, break_on_hyphens=False).fill
    return "\n".join(line if line.startswith("|") else fill(line) for line in markdown.split("\n"))


if __name__ == "__main__":
    main()
