"""How many cells one computer bears: each reads a recording of 1 kHz and 7 joints, paced in real time, through a
twin and the detector twin_regression.

    python3 benches/cells.py target/release/tauscope 50 100 150 [--seconds 20] [--processes cell|one|apart]

For each number of cells it prints the time until all have begun, the computing time in cores while all run, the memory
of all processes, how late the run ended, and whether a sample was dropped. `cell`: a process a cell; `one`: one for all;
`apart`: one a stage.
"""

import argparse
import json
import os
import pathlib
import resource
import subprocess
import tempfile
import threading
import time

DATA = pathlib.Path(__file__).resolve().parent.parent / "tests" / "data"

SCENARIO = """version: 1
name: cells
robot: {robot}
rate_hz: 1000
recordings:
  - name: loop
    duration_s: {seconds}
    motion: {{fourier: {{period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}}}
"""


def pipeline(cells, processes, recording, rate="realtime"):
    """The pipeline file of so many cells."""
    robot = DATA / "demo_arm.urdf"
    lines = ["version: 1"] + (["process: cells"] if processes == "one" else []) + ["cells:"]
    lines += [f"  c{n}: {{robot: {robot}}}" for n in range(cells)] + ["stages:"]
    for n in range(cells):
        own = (lambda name: f", process: {name}") if processes == "apart" else (lambda name: "")
        lines += [
            f"- {{name: in{n}{own(f'in{n}')}, cell: c{n}, ingest: {{file: {{path: {recording}}}, rate: {rate}}}}}",
            f"- {{name: twin{n}{own(f'twin{n}')}, input: in{n}, twin: {{}}}}",
            f"- {{name: detect{n}{own(f'detect{n}')}, input: twin{n}, "
            "detect: {twin_regression: {}, threshold: {score: 1000}}}",
        ]
    return "\n".join(lines) + "\n"


def memory_mb(parent):
    """Memory of a process and its children, shared pages divided among those that share them [MB]."""
    total = 0
    children = pathlib.Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    for process in [str(parent), *children]:
        try:
            rollup = pathlib.Path(f"/proc/{process}/smaps_rollup").read_text()
        except OSError:
            continue
        total += sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))
    return total / 1024


def computing_s(parent):
    """Computing time of a process's children so far [s]."""
    total = 0
    for process in pathlib.Path(f"/proc/{parent}/task/{parent}/children").read_text().split() + [str(parent)]:
        fields = pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        total += int(fields[11]) + int(fields[12])
    return total / os.sysconf("SC_CLK_TCK")


def watch(parent, seconds, seen):
    """Measures a run that has just begun: computing time over the middle of it, and memory at its end."""
    try:
        time.sleep(0.2 * seconds)
        before, since = computing_s(parent), time.monotonic()
        time.sleep(0.5 * seconds)
        seen["cores"] = (computing_s(parent) - before) / (time.monotonic() - since)
        seen["memory_mb"] = memory_mb(parent)
    except OSError:
        # It has ended early, which its row says.
        pass


def run(program, folder, cells, args, recording):
    """One run; its row."""
    seconds = args.seconds
    (folder / "pipeline.yaml").write_text(pipeline(cells, args.processes, recording, args.rate))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.monotonic()
    process = subprocess.Popen(
        [program, "run", "--json", "--verbose", "pipeline.yaml"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    begun, seen = [], {}

    def listen():
        for line in process.stderr:
            if line.startswith("stage `") and " begins" in line:
                begun.append(time.monotonic() - started)
            if len(begun) == 3 * cells and line.startswith("stage `"):
                threading.Thread(target=watch, args=(process.pid, seconds, seen)).start()

    listener = threading.Thread(target=listen)
    listener.start()
    summary = json.load(process.stdout)
    code = process.wait()
    wall = time.monotonic() - started
    listener.join()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    ready = max(begun, default=float("nan"))
    dropped = sum(stage["dropped"] for stage in summary["stages"])
    emitted = sum(s["emitted"] for s in summary["stages"] if s["stage"].startswith("detect"))
    late = wall - ready - seconds
    print(
        f"| {cells} | {args.processes} | {args.rate} | {ready:.1f} | {seen.get('cores', 0):.2f} | {1e6 * cpu_s / (emitted or 1):.1f} | {seen.get('memory_mb', 0):.0f} "
        f"| {late:.1f} | {emitted} | {dropped} | {code} |",
        flush=True,
    )


def main():
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("cells", type=int, nargs="+")
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--processes", choices=["cell", "one", "apart"], default="cell")
    parser.add_argument("--rate", default="realtime", help="as the source's `rate`; `fast` shows what pacing costs")
    args = parser.parse_args()
    program = args.program.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scenario = SCENARIO.format(robot=DATA / "demo_arm.urdf", seconds=args.seconds)
        (folder / "scenario.yaml").write_text(scenario)
        simulated = [program, "simulate", "scenario.yaml", "--out", "simulated"]
        subprocess.run(simulated, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        recording = next((folder / "simulated").rglob("*.mcap"))
        print(f"{os.cpu_count()} cores, {args.seconds} s")
        print("| cells | processes | rate | begun [s] | cores | time a sample [us] | memory [MB] | late [s] | judged | dropped | exit |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
        for cells in args.cells:
            run(program, folder, cells, args, recording)


if __name__ == "__main__":
    main()
