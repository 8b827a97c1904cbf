#!/usr/bin/env python3
"""An archive of many recordings, replayed undisturbed, killed midway, and by runners that meet: the same files.

    tests/archives/thousand.py target/release/tauscope /tmp/thousand
    tests/archives/thousand.py PROGRAM FOLDER --recordings 20 --seconds 1.5          a short form
    tests/archives/thousand.py PROGRAM FOLDER --recordings 100000 --seconds 1        for the brave
    tests/archives/thousand.py PROGRAM FOLDER --cluster query/target/release/tauscope-cluster

`tauscope simulate` makes the recordings (query/benches/archive.py), unless FOLDER has them from a run before. One line
for each demand; exit code 1 if one is missed. With `--cluster`, and `tauscope-query` beside that program, the same query
is asked of one process and of a scheduler with two executors, of which one is killed in the middle.
"""

import argparse
import contextlib
import hashlib
import importlib.util
import json
import pathlib
import shutil
import socket
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Memory at the end of an archive over that after its first tenth: a leak of 30 kB a recording is 27 MB.
FLAT_MB = 10.0
PIPELINE = """version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: archive/r000000.mcap}}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: contact, input: twin, detect: {{twin_regression: {{}}, threshold: {{score: 4}}}}}}
- {{name: observer, input: twin, detect: {{momentum_observer: {{}}, threshold: {{score: 4}}}}}}
"""
missed = 0


def demand(holds, text):
    """One line for one demand."""
    global missed
    missed += not holds
    print(f"{'ok  ' if holds else 'MISS'}  {text}", flush=True)


def archive(program, folder, args):
    """The folder of the recordings, made unless it is there."""
    out = folder / "archive"
    made = folder / "made.json"
    wanted = {"recordings": args.recordings, "seconds": args.seconds, "rate_hz": args.rate_hz}
    if not made.exists() or json.loads(made.read_text()) != wanted:
        shutil.rmtree(out, ignore_errors=True)
        spec = importlib.util.spec_from_file_location("archive", ROOT / "query" / "benches" / "archive.py")
        maker = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(maker)
        begun = time.monotonic()
        maker.make(program, out, **wanted)
        print(f"      made in {time.monotonic() - begun:.0f} s")
        made.write_text(json.dumps(wanted))
    return out


class Runner:
    """`tauscope replay --manifest` at work, its memory watched."""

    def __init__(self, program, folder, out, *more):
        command = [program, "replay", "--manifest", folder / "manifest.jsonl", "--pipeline", folder / "pipeline.yaml"]
        self.out = out
        self.process = subprocess.Popen(
            [*command, "--out", out, "--json", *more], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.peaks = []
        self.watcher = threading.Thread(target=self.watch)
        self.watcher.start()

    def watch(self):
        """Notes how many results there are, and the most memory so far [MB]."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status")
        while self.process.poll() is None:
            with contextlib.suppress(OSError, StopIteration):
                line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
                self.peaks.append((len(results(self.out)), int(line.split()[1]) / 1024))
            time.sleep(0.1)

    def summary(self):
        """Waits for its end and gives what it says."""
        told = json.loads(self.process.stdout.read() or "{}")
        self.process.wait()
        self.watcher.join()
        return told

    def kill_after(self, count):
        """`kill -9` as soon as there are so many results; whether it was still at work."""
        while self.process.poll() is None and len(results(self.out)) < count:
            # To list a large archive takes time, which the runners should have.
            time.sleep(min(0.1, 0.0005 * count))
        at_work = self.process.poll() is None
        self.process.kill()
        self.process.wait()
        self.watcher.join()
        return at_work


def results(out):
    """The names of all results."""
    return [path for path in out.glob("cell=*/day=*/*.parquet")]


def fingerprint(out):
    """Each result's name and the hash of its bytes."""
    hashed = {}
    for path in results(out):
        hashed[str(path.relative_to(out))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return hashed


def undisturbed(program, folder, count):
    """One runner from the beginning to the end."""
    out = folder / "alone"
    begun = time.monotonic()
    runner = Runner(program, folder, out)
    told = runner.summary()
    took = time.monotonic() - begun
    demand(runner.process.returncode == 0 and told.get("replayed") == count,
           f"one runner replays {told.get('replayed')} of {count} recordings in {took:.1f} s")
    early = [mb for done, mb in runner.peaks if 0 < done <= max(2, count // 10)]
    if early:
        first, last = max(early), runner.peaks[-1][1]
        demand(last - first <= FLAT_MB, f"memory is flat: {first:.1f} MB after a tenth, {last:.1f} MB at the end")
    else:
        print("      too short to see its memory")
    return fingerprint(out)


def disturbed(program, folder, count, expected, name, halves):
    """Killed midway, then two runners at once, of which one is killed when there is not shards to make it needed."""
    out = folder / name
    at_work = Runner(program, folder, out).kill_after(max(1, count // 3))
    before = len(results(out))
    demand(at_work and before < count, f"{name}: killed (-9) with {before} of {count} results")
    runners = [Runner(program, folder, out, *more) for more in halves]
    if not halves[0]:
        at_work = runners.pop().kill_after(max(before + 1, 2 * count // 3))
        print(f"      {name}: of two runners one is killed {'at work' if at_work else 'after its end'}")
    told = [runner.summary() for runner in runners]
    done = [(one.get("done_before", 0), one.get("replayed", 0), one.get("by_another_runner", 0)) for one in told]
    said = "; ".join(f"{a} were there, {b} replayed, {c} by the other meanwhile" for a, b, c in done)
    recordings = sum(one.get("recordings", 0) for one in told)
    demand(all(runner.process.returncode == 0 for runner in runners) and sum(map(sum, done)) == recordings == count,
           f"{name}: {said}")
    again = sum(b + c for _, b, c in done)
    demand(again <= count - before, f"{name}: {again} of {count - before} that were missing were done, none that was there")
    same = fingerprint(out) == expected
    demand(same, f"{name}: the same {len(expected)} files byte for byte as undisturbed")
    last = Runner(program, folder, out).summary()
    left = list((out / "unfinished").iterdir())
    demand(last.get("done_before") == count and not left, f"{name}: nothing is left to do, nothing unfinished stays")


class Program:
    """A program of the cluster, ended with the block."""

    def __init__(self, *command):
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def cpu_s(self):
        """Computing time so far."""
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / 100

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


def listens(port):
    """Waits until somebody listens there."""
    for _ in range(600):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
            return
        time.sleep(0.1)
    sys.exit(f"nobody listens at port {port}")


def free_ports(count):
    """So many free ports in a row."""
    for first in range(50050, 60000, count):
        with contextlib.ExitStack() as held, contextlib.suppress(OSError):
            for port in range(first, first + count):
                held.enter_context(socket.create_server(("127.0.0.1", port)))
            return first
    sys.exit("no free ports")


def queries(cluster, folder):
    """The same question to one process and to a scheduler with two executors."""
    sql = (
        f"select recording, row, stage, joint, link, t_ns, samples, score, residual_rms "
        f"from replay('{folder / 'pipeline.yaml'}', '{folder}/archive/**/*.mcap') "
        "order by recording, row, stage, joint, t_ns"
    )
    alone = [cluster.with_name("tauscope-query"), sql, "--format", "json"]
    begun = time.monotonic()
    expected = subprocess.run(alone, check=True, stdout=subprocess.PIPE).stdout
    one_s = time.monotonic() - begun
    events = expected.count(b'"row":"event"')
    demand(events > 0, f"a query in one process: {expected.count(10)} rows, {events} of events, in {one_s:.1f} s")
    port = free_ports(5)
    address = f"127.0.0.1:{port}"
    with Program(cluster, "scheduler", "--listen", address):
        listens(port)
        tasks = ("--scheduler", address, "--tasks", "1")
        with Program(cluster, "executor", *tasks, "--port", str(port + 1)) as first, \
             Program(cluster, "executor", *tasks, "--port", str(port + 3)) as second:
            listens(port + 1), listens(port + 3)
            idle = first.cpu_s(), second.cpu_s()
            begun = time.monotonic()
            asked = subprocess.Popen(
                [cluster, "query", "--scheduler", address, "--deadline-s", "1800", sql, "--format", "json"],
                stdout=subprocess.PIPE,
            )
            # A third of what one process needs, shared by two.
            enough = max(0.3, one_s / 6)
            while asked.poll() is None and (
                first.cpu_s() < idle[0] + enough or second.cpu_s() < idle[1] + enough
            ):
                time.sleep(0.02)
            at_work = asked.poll() is None
            second.process.kill()
            answer = asked.stdout.read()
            code = asked.wait()
            took = time.monotonic() - begun
    demand(at_work, "one of two executors is killed (-9) while both work")
    demand(code == 0 and answer == expected, f"the sorted answer is the same, byte for byte, after {took:.1f} s")


def main():
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rate-hz", type=float, default=250)
    parser.add_argument("--cluster", type=pathlib.Path)
    parser.add_argument("--only", choices=["replay", "query"])
    args = parser.parse_args()
    program, folder, count = args.program.resolve(), args.folder.resolve(), args.recordings
    folder.mkdir(parents=True, exist_ok=True)
    recordings = archive(program, folder, args)
    size = sum(path.stat().st_size for path in recordings.rglob("*.mcap")) * 1e-6
    demand(len(list(recordings.rglob("*.mcap"))) == count,
           f"{count} recordings of {args.seconds:g} s at {args.rate_hz:g} Hz, {size:.0f} MB")
    (folder / "pipeline.yaml").write_text(PIPELINE.format(robot=ROOT / "tests" / "data" / "demo_arm.urdf"))
    if args.only != "query":
        for old in ("alone", "killed", "shards"):
            shutil.rmtree(folder / old, ignore_errors=True)
        subprocess.run([program, "manifest", f"{recordings}/**/*.mcap", "--out", folder / "manifest.jsonl", "--force"],
                       check=True, stderr=subprocess.DEVNULL)
        expected = undisturbed(program, folder, count)
        disturbed(program, folder, count, expected, "killed", [[], []])
        disturbed(program, folder, count, expected, "shards", [["--shard", "0/2"], ["--shard", "1/2"]])
    if args.cluster is None:
        print("SKIPPED  queries: no --cluster")
    elif args.only != "replay":
        queries(args.cluster.resolve(), folder)
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
