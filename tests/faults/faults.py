#!/usr/bin/env python3
"""Faults done to running pipelines: what was lost must be what the summary says, to the sample.

    tests/faults/faults.py PROGRAM [--short] [--kills 100] [--slack 1] [--only NAME]...

PROGRAM is the built tauscope. Every scenario runs a robot of 7 joints at 1 kHz and ends with one line: what was done,
what was lost, what was said. `--short` kills and cuts less often and for less long, and
holds no tight bound on time. Needs Linux and Python 3.10; scenarios with network namespaces or a mounted disk need root
and are skipped, visibly, without.
"""
import argparse
import contextlib
import ctypes
import importlib.util
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

from hosts import Hosts, Skipped

# A killed stage is back, a killed cell and one that was cut off are known, within so long on a quiet machine.
BACK_S, KILLED_IS_KNOWN_S, CUT_IS_KNOWN_S = 1.0, 1.0, 5.0
# What a recorder that is killed has taken and not kept yet.
UNKEPT_S = 0.1
# The short form may run beside others, which make everything later; it tells whether, not how soon.
BUSY = 10.0
slack = 1.0

HERE = Path(__file__).resolve().parent
DATA = HERE.parent / "data"
SCENARIO = """version: 1
name: faults
robot: {data}/demo_arm.urdf
rate_hz: 1000
recordings:
  - name: loop
    duration_s: {seconds}
    motion: {{fourier: {{period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}}}
"""
STAGES = ["ingest", "twin", "detect", "record"]
PIPELINE = """version: 1
cells: {{demo: {{robot: {data}/demo_arm.urdf}}}}
{hosts}stages:
- {{name: ingest, {a}process: ingest, ingest: {{{source}, rate: realtime}}}}
- {{name: twin, {a}process: twin, input: ingest, twin: {{}}}}
- {{name: detect, {b}process: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000.0}}}}}}
- {{name: record, {b}inputs: [ingest, twin, detect], record: {{mcap: {out}/out.mcap, min_free_mb: {free}}}}}
"""


class Failed(Exception):
    """Something is not as it must be."""


def check(condition, *what):
    if not condition:
        raise Failed(" ".join(str(part) for part in what))


class Run:
    """One `tauscope run`, heard line by line."""

    def __init__(self, program, folder, more=(), prefix=()):
        command = [*prefix, program, "run", "--json", "pipeline.yaml", *more]
        self.process = subprocess.Popen(
            command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.lines, self.ids = [], {}
        self.out = []
        self.readers = [threading.Thread(target=self._hear), threading.Thread(target=self._read)]
        for reader in self.readers:
            reader.start()

    def _hear(self):
        for line in self.process.stderr:
            self.lines.append((time.monotonic(), line.rstrip()))
            if " runs as process " in line:
                name, process = line.split("`")[1], int(line.split()[-1])
                self.ids[name] = process

    def _read(self):
        self.out.append(self.process.stdout.read())

    def wait_for(self, what, within=60.0):
        """When the first line that holds `what` came."""
        deadline = time.monotonic() + within
        while time.monotonic() < deadline:
            for at, line in list(self.lines):
                if what in line:
                    return at
            time.sleep(0.02)
        raise Failed("no line with", repr(what), "in", self.text())

    def begun(self):
        deadline = time.monotonic() + 60
        while set(self.ids) < set(STAGES) and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(1.5)

    def handled(self, stage):
        """How many samples a stage has dealt with in all its lives, from the file in which it counts them."""
        try:
            maps = Path(f"/proc/{self.ids[stage]}/maps").read_text().splitlines()
            own = {int(line.split()[4]) for line in maps if "memfd:ledger" in line}
            for each in Path(f"/proc/{self.process.pid}/fd").iterdir():
                if "memfd:ledger" in os.readlink(each) and each.stat().st_ino in own:
                    # A recorder puts nothing out; what it has taken of its first input stands behind.
                    place = 16 if stage == "record" else 0
                    return struct.unpack_from("=Q", each.read_bytes(), place)[0]
        except OSError:
            pass
        return None

    def text(self):
        return "\n".join(line for _, line in self.lines)

    def end(self, within=180.0):
        """Exit code and summary."""
        try:
            code = self.process.wait(within)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise Failed("it does not end:", self.text()) from None
        for reader in self.readers:
            reader.join()
        check(self.out[0], "no summary:", self.text())
        return code, json.loads(self.out[0])


# Where the samples come from. One that is simulated is simulated anew up to where it was, whenever it was killed.
SIMULATED, RECORDED = "simulate: {scenario: scenario.yaml}", "file: {path: recording/loop.mcap}"


def make(folder, seconds, hosts="", a="", b="", out=".", free=100, source=SIMULATED):
    (folder / "scenario.yaml").write_text(SCENARIO.format(data=DATA, seconds=seconds))
    (folder / "pipeline.yaml").write_text(
        PIPELINE.format(data=DATA, hosts=hosts, a=a, b=b, out=out, free=free, source=source))


def record(program, folder):
    """The scenario as a recording."""
    command = [program, "simulate", "scenario.yaml", "--out", "recording"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def link(summary, one, other):
    return next(link for link in summary["links"] if (link["from"], link["to"]) == (one, other))


def emitted(summary, stage):
    return next(each["emitted"] for each in summary["stages"] if each["stage"] == stage)


def balance(summary):
    """The books of every link, and what is lost in all."""
    lost = 0
    for each in summary["links"]:
        sent, got, dropped = each["emitted"], each["received"], each["dropped"]
        check(each["surplus"] == 0, "more received than sent:", each)
        if got is not None:
            check(sent == got + dropped, "the books do not balance:", each)
        check(dropped <= sent, "more dropped than sent:", each)
        lost += dropped
    return lost


def archived(program, folder):
    """Messages by topic in all archives of a folder."""
    counts = {}
    for path in sorted(folder.glob("**/*.mcap")):
        if path.parent.name == "recording":
            continue
        info = subprocess.run([program, "info", "--json", path], capture_output=True, text=True, check=False)
        check(info.stdout, path, info.stderr)
        for topic in json.loads(info.stdout)["topics"]:
            counts[topic["name"]] = counts.get(topic["name"], 0) + topic["message_count"]
    return counts


# One message for every sample; a detection is written only where it says something.
TOPICS = {"ingest": "/joint_states", "twin": "/twin/joint_states"}


def back(run, victim):
    """Kills a stage and says how soon it dealt with a sample again, and how busy the machine is [s, load]."""
    before, at = run.ids[victim], time.monotonic()
    os.kill(before, signal.SIGKILL)
    first = None
    while time.monotonic() < at + 30:
        if run.ids[victim] != before:
            handled = run.handled(victim)
            first = handled if first is None else first
            if handled is not None and handled > first:
                return time.monotonic() - at, os.getloadavg()[0]
        time.sleep(0.005)
    raise Failed(victim, "did not come back:", run.text())


def kill(program, folder, victim, times, seconds):
    make(folder, seconds, source=RECORDED)
    record(program, folder)
    run = Run(program, folder)
    run.begun()
    took = []
    for number in range(times):
        took.append(back(run, victim))
        if number + 1 < times:
            # Five deaths within ten seconds are too many.
            time.sleep(3.0)
    code, summary = run.end()
    lost = balance(summary)
    check(code == (3 if lost else 0), "exit code", code, "with", lost, "lost")
    slowest, load = max(took)
    whole = seconds * 1000
    check(abs(emitted(summary, "ingest") - whole) <= 2, emitted(summary, "ingest"), "of", whole, "samples emitted")
    undisturbed(summary, victim)
    # What the recorder has taken is in the archive, but for what died with it.
    counts = archived(program, folder)
    unkept = 0
    for stage, topic in TOPICS.items():
        missing = link(summary, stage, "record")["received"] - counts.get(topic, 0)
        # On average: a few kills have none.
        most = times * UNKEPT_S * 1000 * (slack if times < 10 else 1) if victim == "record" else 0
        check(0 <= missing <= most, missing, "of", topic, "were taken and are not there:", counts, summary["links"])
        unkept = max(unkept, missing)
    median = sorted(took)[times // 2][0]
    told = f"{times} kills, samples again within {slowest * 1000:.0f} ms at a load of {load:.0f}, half of the times "
    told += f"within {median * 1000:.0f} ms; {lost} samples lost, {lost} counted, exit {code}"
    if victim == "record":
        told += f"; of a stream {unkept / times:.0f} samples a kill were taken and not kept; "
        told += repaired(program, folder, counts)
    # At last, so that it is known what else holds on a machine that is too busy.
    check(slowest < BACK_S * slack, "too late:", told)
    return told


def undisturbed(summary, victim):
    """Between stages that were not killed nothing is lost, and none of them was started again."""
    for each in summary["links"]:
        if victim not in (each["from"], each["to"]):
            check(each["dropped"] == 0, "a link that nobody harmed:", each)
    for each in summary["stages"]:
        check(each["stage"] == victim or each["restarts"] == 0, "it was started again:", each)


def repaired(program, folder, counts):
    """The pieces of a killed recorder become one file, which another reader reads as well."""
    pieces = sorted(folder.glob("*.mcap"))
    out = folder / "repaired" / "all.mcap"
    out.parent.mkdir()
    done = subprocess.run([program, "repair", *pieces, "--out", out], capture_output=True, text=True, check=False)
    check(done.returncode == 0, "repair:", done.returncode, done.stdout, done.stderr)
    check(archived(program, out.parent) == counts, "repair has lost samples:", archived(program, out.parent), counts)
    if not importlib.util.find_spec("mcap"):
        return f"{len(pieces)} pieces joined; SKIPPED the reader of PyPI: the package `mcap` is absent"
    from mcap.reader import make_reader
    with out.open("rb") as file:
        read = {}
        for _, channel, _ in make_reader(file, validate_crcs=True).iter_messages():
            read[channel.topic] = read.get(channel.topic, 0) + 1
    for topic, count in counts.items():
        check(read.get(topic, 0) == count, topic, "has", count, "messages, the reader of PyPI finds", read)
    return f"{len(pieces)} pieces joined, {sum(read.values())} messages read by the package `mcap`"


def freeze(program, folder, victim, pause, seconds):
    make(folder, seconds)
    run = Run(program, folder)
    run.begun()
    os.kill(run.ids[victim], signal.SIGSTOP)
    time.sleep(pause)
    os.kill(run.ids[victim], signal.SIGCONT)
    code, summary = run.end()
    lost = balance(summary)
    check(code == (3 if lost else 0), "exit code", code, "with", lost, "lost")
    if victim == "record":
        check(link(summary, "twin", "detect")["dropped"] == 0, "the detector lost samples:", summary["links"])
    return f"stopped for {pause} s, {lost} samples lost and counted, exit {code}"


def clock_set(program, folder, seconds):
    """The host's clock is set an hour forward, then two hours back, while the pipeline runs."""
    places = [*Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"), *Path("/usr/lib/faketime").glob("libfaketimeMT.so.1")]
    if not places:
        raise Skipped("no libfaketime: apt-get install faketime")
    make(folder, seconds)
    clock = folder / "clock"
    clock.write_text("+0s")
    settings = [f"LD_PRELOAD={places[0]}", f"FAKETIME_TIMESTAMP_FILE={clock}", "FAKETIME_NO_CACHE=1",
                "DONT_FAKE_MONOTONIC=1", "NO_FAKE_STAT=1"]
    told = subprocess.run(["env", *settings, "date", "+%s"], capture_output=True, text=True, check=True)
    check(abs(int(told.stdout) - time.time()) < 5, "the clock is not the host's:", told.stdout)
    run = Run(program, folder, prefix=("env", *settings))
    run.begun()
    for offset in ("+3600s", "-3600s"):
        clock.write_text(offset)
        time.sleep(3)
    told = subprocess.run(["env", *settings, "date", "+%s"], capture_output=True, text=True, check=True)
    check(abs(int(told.stdout) - time.time() + 3600) < 5, "the clock was not set:", told.stdout)
    code, summary = run.end()
    lost = balance(summary)
    check((code, lost) == (0, 0), "exit code", code, "with", lost, "lost:", run.text())
    held = archived(program, folder)[TOPICS["ingest"]]
    check(held == emitted(summary, "ingest"), "the archive holds", held, "of", emitted(summary, "ingest"))
    return f"an hour forward, two hours back: {held} samples, none lost, exit {code}"


SHARED = """version: 1
process: cells
cells: {{a: {{robot: {data}/demo_arm.urdf}}, b: {{robot: {data}/demo_arm.urdf}}}}
stages:
"""
SHARED_CELL = """- {{name: in_{cell}, cell: {cell}, ingest: {{simulate: {{scenario: scenario.yaml}}, rate: realtime}}}}
- {{name: twin_{cell}, input: in_{cell}, twin: {{}}}}
- {{name: detect_{cell}, input: twin_{cell}, detect: {{naive_difference: {{}}, threshold: {{score: 1000.0}}}}}}
"""
# A stage that hangs is named after 3 s of silence, and its silence noticed after 1 s.
HANG_IS_NAMED_S = 5.0
PTRACE_DETACH, PTRACE_SEIZE, PTRACE_INTERRUPT = 17, 0x4206, 0x4207


class Held:
    """A thread that does not go on, while the others of its process do: it is traced."""

    def __init__(self, process, name):
        self.libc = ctypes.CDLL(None, use_errno=True)
        self.libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
        tasks = Path(f"/proc/{process}/task").iterdir()
        self.thread = next(int(task.name) for task in tasks if (task / "comm").read_text().strip() == name)
        if self.libc.ptrace(PTRACE_SEIZE, self.thread, None, None) != 0:
            raise Skipped(f"a thread cannot be traced: {os.strerror(ctypes.get_errno())}")
        self.libc.ptrace(PTRACE_INTERRUPT, self.thread, None, None)
        # `__WALL`: threads as well.
        os.waitpid(self.thread, 0x40000000)

    def go_on(self):
        self.libc.ptrace(PTRACE_DETACH, self.thread, None, None)


def hang(program, folder, pause, seconds):
    """The thread of one of two cells in one process hangs: it is named, and the other cell does not notice."""
    (folder / "scenario.yaml").write_text(SCENARIO.format(data=DATA, seconds=seconds))
    cells = "".join(SHARED_CELL.format(cell=cell) for cell in "ab")
    (folder / "pipeline.yaml").write_text(SHARED.format(data=DATA) + cells)
    run = Run(program, folder)
    try:
        run.wait_for("stage `in_a` runs as process")
        time.sleep(4.0)
        begin = time.monotonic()
        held = Held(run.ids["in_a"], "in_a")
        time.sleep(pause)
        held.go_on()
        named = run.wait_for("stage `in_a` hangs") - begin
        run.wait_for("stage `in_a` responds again")
        code, summary = run.end()
    finally:
        run.process.kill()
    others = [line for _, line in run.lines if " hangs: " in line and "`in_a`" not in line]
    check(not others, "others were named:", others)
    check(named < HANG_IS_NAMED_S * slack, f"it was named after {named:.1f} s")
    check(balance(summary) == 0 and code == 0, "exit code", code, summary["links"])
    check(all(stage["restarts"] == 0 for stage in summary["stages"]), "one was started again:", summary["stages"])
    return f"held for {pause} s, named after {named:.1f} s, no other stage named, 0 lost, exit {code}"


def full_disk(program, folder, seconds):
    disk = folder / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", disk], capture_output=True, text=True,
                             check=False)
    if mounted.returncode:
        raise Skipped(f"a tmpfs cannot be mounted: {mounted.stderr.strip()}")
    try:
        make(folder, seconds, out=disk, free=1)
        run = Run(program, folder)
        code, summary = run.end()
        check(balance(summary) == 0, "a link lost samples:", summary["links"])
        check("recording pauses" in run.text(), "nobody says that the disk is full:", run.text())
        check(emitted(summary, "detect") >= seconds * 1000 - 2, "detection ended:", summary["stages"])
        lost = next(each["dropped"] for each in summary["stages"] if each["stage"] == "record")
        check(lost > 0 and code == 3, "exit code", code, "with", lost, "not kept")
        taken = link(summary, "ingest", "record")["received"] + link(summary, "twin", "record")["received"]
        kept = sum(archived(program, folder)[topic] for topic in TOPICS.values())
        check(taken - lost <= kept < taken, kept, "kept of", taken, "with", lost, "counted as lost")
        return f"4 MB disk: detection went on, {lost} samples not kept and counted, exit {code}"
    finally:
        subprocess.run(["umount", "-l", disk], check=False)


def full_shared_memory(program, folder, seconds):
    """A small /dev/shm of its own that fills up while a stage lags, so that its sender needs more of it."""
    small = "mount -t tmpfs -o size=12m tmpfs /dev/shm && exec \"$@\""
    own = ["unshare", "-m", "sh", "-c", small, "sh"]
    tried = subprocess.run([*own, "true"], capture_output=True, text=True, check=False)
    if tried.returncode:
        raise Skipped(f"no /dev/shm of its own: {tried.stderr.strip()}")
    make(folder, seconds, source=RECORDED)
    record(program, folder)
    run = Run(program, folder, prefix=own)
    run.begun()
    fill = "head -c 1G /dev/zero > /dev/shm/full"
    subprocess.run(["nsenter", "-t", str(run.process.pid), "-m", "sh", "-c", fill], capture_output=True, check=False)
    lags = run.ids["detect"]
    os.kill(lags, signal.SIGSTOP)
    time.sleep(6.0)
    with contextlib.suppress(ProcessLookupError):
        os.kill(lags, signal.SIGCONT)
    code, summary = run.end()
    lost = balance(summary)
    check("bus error, as 0 MB are free in /dev/shm; make it larger" in run.text(), "nobody says why:", run.text())
    # Whether it dies often enough to be given up depends on how busy the machine is.
    check(code in (1, 3), "exit code", code, "with", lost, "lost")
    there = archived(program, folder)[TOPICS["ingest"]]
    taken = link(summary, "ingest", "record")["received"]
    check(there == taken, there, "in the archive of", taken)
    return f"told, with the remedy; {lost} lost and counted, {there} of {taken} in the archive, exit {code}"


def across(program, folder, hosts, seconds, fault, connect=None):
    """Source and twin on one host, detector and recorder on the other; what both say, and what is in the archive."""
    router = f"{hosts.addresses[0]}:7447"
    listed = f'hosts: {{a: {{listen: "tcp/{router}"}}, b: {{connect: "tcp/{connect or router}"}}}}\n'
    make(folder, seconds, listed, "host: a, ", "host: b, ")
    runs = [Run(program, folder, ["--host", name], hosts.enter(place)) for place, name in enumerate("ab")]
    try:
        runs[1].wait_for("stage `record` runs")
        time.sleep(4.0)
        fault(runs)
        (near, sent), (far, got) = [run.end(seconds + 120) for run in runs]
    finally:
        for run in runs:
            run.process.kill()
    lost = balance(sent) + balance(got)
    whole = emitted(sent, "ingest")
    check(abs(whole - seconds * 1000) <= 2, "the source stopped:", whole, "of", seconds * 1000)
    taken = link(got, "ingest", "record")
    check(taken["emitted"] == whole, "the far host knows of", taken["emitted"], "samples, emitted were", whole)
    check(far == (3 if balance(got) else 0), "exit code", far, "of the far host with", balance(got), "lost")
    counts = archived(program, folder)
    check(counts[TOPICS["ingest"]] == taken["received"], counts, taken)
    return (f"{whole} joint states emitted, {taken['dropped']} lost and counted, {lost} samples of all streams; "
            f"exits {near} and {far}")


def cut(program, folder, pause, seconds):
    hosts = Hosts()

    def fault(_):
        hosts.cut()
        time.sleep(pause)
        hosts.mend()

    try:
        return f"cut for {pause} s: " + across(program, folder, hosts, seconds, fault)
    finally:
        hosts.close()


def far_freeze(program, folder, pause, seconds):
    hosts = Hosts()

    def fault(runs):
        os.kill(runs[1].ids["record"], signal.SIGSTOP)
        time.sleep(pause)
        os.kill(runs[1].ids["record"], signal.SIGCONT)

    try:
        return f"stopped for {pause} s: " + across(program, folder, hosts, seconds, fault)
    finally:
        hosts.close()


def far_kill(program, folder, times, seconds):
    hosts = Hosts()

    def fault(runs):
        for _ in range(times):
            os.kill(runs[0].ids["ingest"], signal.SIGKILL)
            time.sleep(3.0)

    try:
        return f"{times} kills: " + across(program, folder, hosts, seconds, fault)
    finally:
        hosts.close()


def poor_network(program, folder, seconds):
    hosts = Hosts()
    proxy = [*hosts.enter(1), sys.executable, HERE / "poor_network.py", "127.0.0.1:7449", f"{hosts.addresses[0]}:7447"]
    process = subprocess.Popen([str(word) for word in proxy])
    try:
        return "50 ms, 5 % loss: " + across(program, folder, hosts, seconds, lambda _: None, "127.0.0.1:7449")
    finally:
        process.kill()
        process.wait()
        hosts.close()


def restarted(program, folder, place, seconds):
    """All processes of one host die at once, as in a power cut, and its run is started again 3 s later."""
    hosts = Hosts()
    router = f"{hosts.addresses[0]}:7447"
    listed = f'hosts: {{a: {{listen: "tcp/{router}"}}, b: {{connect: "tcp/{router}"}}}}\n'
    make(folder, seconds, listed, "host: a, ", "host: b, ", source=RECORDED)
    record(program, folder)
    start = lambda at: Run(program, folder, ["--host", "ab"[at]], hosts.enter(at))
    runs, dead = [start(0), start(1)], None
    try:
        runs[1].wait_for("stage `record` runs")
        time.sleep(8.0)
        dead = runs[place]
        hosts.kill(place)
        dead.process.wait()
        time.sleep(3.0)
        runs[place] = start(place)
        (near, sent), (far, got) = [run.end(seconds + 180) for run in runs]
    finally:
        for run in [*runs, *([dead] if dead else [])]:
            run.process.kill()
        hosts.close()
    balance(sent)
    stated = balance(got)
    whole, there = emitted(sent, "ingest"), archived(program, folder)[TOPICS["ingest"]]
    taken = link(got, "ingest", "record")
    # What a sender of before had sent and nobody has heard is known to nobody: it is said that its stream did not end.
    missing = whole - there
    check(missing <= taken["dropped"] + UNKEPT_S * 1000, missing, "are missing, stated are", taken, there, got)
    check(far == 3, "exit code", far, "with", missing, "missing and", stated, "stated:", got)
    if place == 0:
        said = runs[1].text()
        check("number of samples in transit is unknown" in said, "nobody says that a sender was cut off:", said)
    return (f"{whole} emitted by the last life, {there} in the archives, {taken['dropped']} stated as lost; "
            f"exits {near} and {far}")


FLEET_CELL = """version: 1
cells: {{demo: {{robot: {data}/demo_arm.urdf}}}}
stages:
- {{name: ingest, ingest: {{simulate: {{scenario: scenario.yaml}}, rate: realtime}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000.0}}}}}}
- {{name: publish, inputs: [ingest, twin, detect], publish: {{zenoh: {{connect: ["{fleet}"], json: false}}}}}}
"""


def fleet(program, folder, fault):
    """How soon the fleet host knows of a cell that is killed or cut off."""
    hosts = Hosts(alone=True)
    endpoint = f"tcp/{hosts.addresses[1]}:7450"
    (folder / "scenario.yaml").write_text(SCENARIO.format(data=DATA, seconds=120))
    (folder / "pipeline.yaml").write_text(FLEET_CELL.format(data=DATA, fleet=endpoint))
    users = folder / "users"
    subprocess.run([program, "fleet", "--users", users, "--add-user", "anna"], capture_output=True, check=True)
    command = [program, "fleet", "--serve", "127.0.0.1:0", "--users", users, "--expect", "demo", "--listen", endpoint]
    wall = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    cell = None
    try:
        address = next((line.split()[-1] for line in wall.stderr if "the wall is at" in line), None)
        check(address, "the fleet host does not begin")
        threading.Thread(target=wall.stderr.read, daemon=True).start()

        def state():
            with urllib.request.urlopen(address + "fleet.json", timeout=5) as answer:
                cells = json.load(answer)["cells"]
            return next((each["state"] for each in cells if each["cell"] == "demo"), None)

        def wait(reached, within):
            begin = time.monotonic()
            while not reached(state()):
                check(time.monotonic() - begin < within, "the cell is", state(), "after", within, "s")
                time.sleep(0.02)
            return time.monotonic() - begin

        cell = Run(program, folder, prefix=hosts.enter(0))
        wait(lambda seen: seen == "running", 30)
        time.sleep(3.0)
        if fault == "killed":
            # All at once, as its computer would go; a supervisor that is killed alone lets its stages end in order.
            cell.process.send_signal(signal.SIGSTOP)
            for process in cell.ids.values():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            cell.process.kill()
        else:
            hosts.cut()
        took = wait(lambda seen: seen == "stale", 30)
        limit = (KILLED_IS_KNOWN_S if fault == "killed" else CUT_IS_KNOWN_S) * slack
        check(took < limit, f"known after {took:.2f} s, not within {limit} s")
        return f"known after {took:.2f} s"
    finally:
        wall.kill()
        wall.wait()
        if cell:
            cell.process.kill()
        hosts.close()


def scenarios(short, kills):
    times, pause = (2, 3) if short else (kills, 10)
    length = 15 if short else 20 + 45 * kills // 10
    for victim in STAGES:
        yield f"kill -9 of {victim}", lambda program, folder, victim=victim: kill(
            program, folder, victim, times, length)
    for victim in ("record", "twin"):
        yield f"SIGSTOP of {victim}", lambda program, folder, victim=victim: freeze(
            program, folder, victim, pause, pause + 8)
    yield "a clock that is set forward and back", lambda program, folder: clock_set(program, folder, 15)
    yield "a thread that hangs", lambda program, folder: hang(program, folder, max(pause, 7), 25)
    yield "full disk", lambda program, folder: full_disk(program, folder, 15)
    yield "full shared memory", lambda program, folder: full_shared_memory(program, folder, 15)
    for gap in (12,) if short else (12, 30):
        yield f"network cut for {gap} s", lambda program, folder, gap=gap: cut(program, folder, gap, gap + 15)
    yield "SIGSTOP of a recorder on another host", lambda program, folder: far_freeze(
        program, folder, pause, pause + 15)
    yield "kill -9 of a source with listeners on another host", lambda program, folder: far_kill(
        program, folder, min(times, 10), 20 if short else 60)
    for place, name in enumerate(("sends", "listens")):
        yield f"a host that {name} is started again", lambda program, folder, place=place: restarted(
            program, folder, place, 20 if short else 40)
    for fault in ("killed", "cut off"):
        yield f"fleet: a cell {fault}", lambda program, folder, fault=fault: fleet(program, folder, fault)
    yield "poor network", lambda program, folder: poor_network(program, folder, 10 if short else 60)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--kills", type=int, default=100, help="of each stage, in the long form")
    parser.add_argument("--only", action="append", help="scenarios whose name has this in it")
    parser.add_argument("--slack", type=float, default=1.0, help="so many times later on a machine with other work")
    args = parser.parse_args()
    global slack
    slack = BUSY if args.short else args.slack
    program = str(args.program.resolve())
    failed = False
    for name, scenario in scenarios(args.short, args.kills):
        if args.only and not any(part in name for part in args.only):
            continue
        folder = Path(tempfile.mkdtemp(prefix="faults_"))
        try:
            print(f"{name}: {scenario(program, folder)}", flush=True)
        except Skipped as why:
            print(f"SKIPPED {name}: {why}", flush=True)
        except Failed as why:
            failed = True
            print(f"FAILED {name}: {why}", flush=True)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    sys.exit(failed)


if __name__ == "__main__":
    main()
