#!/usr/bin/env python3
"""A plant of many cells that meet one fleet host at a router: nothing may be lost, and who goes is known at once.

    tests/faults/hundred_cells.py PROGRAM [--cells 100] [--rate-hz 1000] [--seconds 600] [--pictures FOLDER]
    tests/faults/hundred_cells.py PROGRAM --short

PROGRAM is the built tauscope. Each cell plays a recording of 7 joints in real time through `ingest`, `twin`, the
detector `twin_regression` and `publish`; every tenth is touched now and then. Nothing but status and alarms leaves a
cell. Meanwhile one cell is killed, one is cut off from the network, one is stopped. `--short` is 10 cells for half a
minute with loose bounds on time. With `--pictures` the wall is taken there with Chromium.

The router is `zenohd` where there is one, otherwise one of Eclipse Zenoh's Python package where that is installed, and
otherwise a second fleet host without a page. Needs Linux and Python 3.10; without root no cell is cut off.
"""
import argparse
import contextlib
import importlib.util
import json
import os
import resource
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

import faults
from faults import CUT_IS_KNOWN_S, DATA, KILLED_IS_KNOWN_S, Failed, Run, balance, check
from hosts import Hosts, Skipped

# A cell that was cut off or stopped is back on the wall within so long after it can be.
BACK_ON_WALL_S = 15.0
# Cells that are played slower than they were recorded would lose nothing by that: the run may end so much late.
LATE_S = 5.0
ROUTER_FILE = faults.HERE.parent.parent / "deploy" / "zenoh" / "router.json5"
PAGE = faults.HERE.parent.parent / "docs" / "page.py"
ROUTER = """import sys, time, zenoh
config = zenoh.Config.from_file(sys.argv[1])
config.insert_json5("listen/endpoints", sys.argv[2])
session = zenoh.open(config)
time.sleep(1e6)
"""
RECORDINGS = """recordings:
  - name: free
    duration_s: {seconds}
    motion: {motion}
  - name: touched
    duration_s: {seconds}
    motion: {motion}
    hands: {{count: {touches}, force_n: [40, 60], duration_s: [0.5, 1.0], after_s: 5}}
"""
MOTION = "{fourier: {period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}"
STAGES = """- {{name: in_{cell}, cell: {cell}, ingest: {{file: {{path: {recording}}}}}}}
- {{name: twin_{cell}, input: in_{cell}, twin: {{model: {data}/demo.twin.yaml}}}}
- {{name: detect_{cell}, input: twin_{cell}, detect: {{twin_regression: {{}}, threshold: {{score: {threshold}}}}}}}
- {{name: tell_{cell}, process: {process}, inputs: [in_{cell}, twin_{cell}, detect_{cell}],
   publish: {{stop_after_s: 5, zenoh: {{connect: ["{router}"], json: false}}}}}}
"""
# What a cell may be that nobody harmed.
ALIVE = ("running", "contact", "not_ready", "ended")
# Scores of free motion stay below a tenth of it, those of the touches above its double.
THRESHOLD = 20.0


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Plant:
    """Router, fleet host and cells, in one folder."""

    def __init__(self, program, folder, args):
        self.program, self.folder, self.args = program, folder, args
        self.ended = contextlib.ExitStack()
        self.hosts = None
        with contextlib.suppress(Skipped):
            self.hosts = Hosts(alone=True)
            self.ended.callback(self.hosts.close)
        self.port = free_port()
        self.record()
        self.route()
        self.watch()

    def record(self):
        """The recordings: the arm and the physics of the bundled one."""
        scenario = (DATA / "demo.scenario.yaml").read_text().split("recordings:")[0]
        scenario = scenario.replace("demo_arm.urdf", str(DATA / "demo_arm.urdf"), 1)
        scenario = scenario.replace("rate_hz: 100", f"rate_hz: {self.args.rate_hz}", 1)
        scenario += RECORDINGS.format(seconds=self.args.seconds, motion=MOTION, touches=max(1, self.args.seconds // 60))
        (self.folder / "scenario.yaml").write_text(scenario)
        command = [self.program, "simulate", "scenario.yaml", "--out", "recordings"]
        subprocess.run(command, cwd=self.folder, check=True, capture_output=True)

    def recording(self, name):
        return next((self.folder / "recordings").rglob(f"{name}.mcap"))

    def begin(self, command, **more):
        process = subprocess.Popen([str(word) for word in command], cwd=self.folder, stdout=subprocess.DEVNULL, **more)
        self.ended.callback(process.wait)
        self.ended.callback(process.kill)
        return process

    def route(self):
        """The router, at the loopback and where the cell that is to be cut off meets it."""
        self.router_at = f"tcp/127.0.0.1:{self.port}"
        endpoints = [self.router_at] + ([f"tcp/{self.hosts.addresses[1]}:{self.port}"] if self.hosts else [])
        listen = [word for endpoint in endpoints for word in ("--listen", endpoint)]
        if shutil.which("zenohd"):
            self.router_is, command = "zenohd", ["zenohd", "-c", ROUTER_FILE, *listen]
        elif importlib.util.find_spec("zenoh"):
            self.router_is = "a router of Eclipse Zenoh's Python package"
            command = [sys.executable, "-c", ROUTER, ROUTER_FILE, json.dumps(endpoints)]
        else:
            self.router_is, command = "tauscope fleet --listen", [self.program, "fleet", *listen]
        self.router = self.begin(command, stderr=subprocess.DEVNULL)

    def watch(self):
        """The fleet host with its page, and one who looks at the page."""
        command = [self.program, "fleet", "--serve", "127.0.0.1:0", "--store", "fleet.sqlite", "--expect", "absent",
                   "--expect", "killed", "--connect", self.router_at]
        self.fleet = self.begin(command, stderr=subprocess.PIPE, text=True)
        self.address = next((line.split()[-1] for line in self.fleet.stderr if "the wall is at" in line), None)
        check(self.address, "the fleet host does not begin")
        threading.Thread(target=self.fleet.stderr.read, daemon=True).start()
        # What the page shows of each cell: the name of its state, and since when.
        self.shown = {}
        threading.Thread(target=self.look, daemon=True).start()

    def look(self):
        with contextlib.suppress(OSError, ValueError), urllib.request.urlopen(self.address + "events") as events:
            for line in events:
                if line.startswith(b"data:"):
                    for cell, tile in json.loads(line[5:])["tiles"].items():
                        state = tile.split('data-state="')[1].split('"')[0]
                        if self.shown.get(cell, ("", 0))[0] != state:
                            self.shown[cell] = (state, time.monotonic())

    def run(self, name, cells, prefix=(), router=None):
        """A computer with these cells. Each is a process, its publisher in it, or all are one."""
        folder = self.folder / name
        folder.mkdir()
        one = self.args.processes == "one"
        lines = ["version: 1"] + (["process: cells"] if one else []) + ["cells:"]
        lines += [f"  {cell}: {{robot: {DATA / 'demo_arm.urdf'}}}" for cell in cells] + ["stages:"]
        text = "\n".join(lines) + "\n"
        for cell in cells:
            text += STAGES.format(
                cell=cell, process="cells" if one else cell, router=router or self.router_at, data=DATA,
                recording=self.recording("touched" if is_touched(cell) else "free"),
                threshold=THRESHOLD if is_touched(cell) else 1e6)
        (folder / "pipeline.yaml").write_text(text)
        run = Run(self.program, folder, prefix=prefix)
        self.ended.callback(end_all, run)
        return run

    def wall(self):
        with urllib.request.urlopen(self.address + "fleet.json", timeout=30) as answer:
            return {view["cell"]: view for view in json.load(answer)["cells"]}

    def wait(self, what, reached, within, begin=None):
        """How long after `begin`, or now, the wall is as wanted."""
        begin = begin or time.monotonic()
        while not reached(wall := self.wall()):
            check(time.monotonic() - begin < within, what, "not within", within, "s:",
                  {cell: view["state"] for cell, view in wall.items() if view["state"] != "running"})
            time.sleep(0.05)
        return time.monotonic() - begin

    def wait_for_page(self, cell, state, since):
        """How long after the instant `since` the page shows a cell so."""
        deadline = time.monotonic() + 30
        while self.shown.get(cell, ("", 0))[0] != state or self.shown[cell][1] < since:
            check(time.monotonic() < deadline, "the page shows", cell, "as", self.shown.get(cell), "not as", state)
            time.sleep(0.01)
        return self.shown[cell][1] - since

    def picture(self, name, height="1500"):
        """The wall as Chromium shows it, wide and narrow."""
        if self.args.pictures is None or not shutil.which("chromium"):
            return
        self.args.pictures.mkdir(parents=True, exist_ok=True)
        for width, scheme in (("1920", "light"), ("390", "dark")):
            to = self.args.pictures / f"{name}_{width}.png"
            taken = subprocess.run([sys.executable, PAGE, self.address, to, width, scheme, height],
                                   capture_output=True, text=True, check=False)
            check(taken.returncode == 0, taken.stderr)


def is_touched(cell):
    return cell.endswith("0")


def end_all(run):
    """Ends a run at once, its stages with it."""
    for process in [*run.ids.values(), run.process.pid]:
        for name in (signal.SIGCONT, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, name)


def tree(parent):
    """A process and its children."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    return [str(parent), *children]


def computing_s(parent):
    """Computing time of a process and its children so far [s]."""
    total = 0
    for process in tree(parent):
        with contextlib.suppress(OSError):
            fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
            total += int(fields[11]) + int(fields[12])
    return total / os.sysconf("SC_CLK_TCK")


def memory_mb(parent):
    """Their memory, shared pages divided among those that share them [MB]."""
    total = 0
    for process in tree(parent):
        with contextlib.suppress(OSError):
            rollup = Path(f"/proc/{process}/smaps_rollup").read_text()
            total += sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))
    return total / 1024


def signal_all(run, name):
    # The supervisor first: it would start again what is killed.
    for process in [run.process.pid, *run.ids.values()]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, name)


def harm(plant, victims, slack, cell_of=str):
    """Kills, cuts off and stops a cell each; how soon that was known, and how soon they were back."""
    told = []

    def known(victim, what, limit, begin):
        cell = cell_of(victim)
        wall = plant.wait(f"{cell} stale", lambda wall: wall[cell]["state"] == "stale", 60, begin)
        page = plant.wait_for_page(cell, "stale", begin)
        told.append(f"a cell that was {what}: known after {wall:.2f} s, on the page after {page:.2f} s")
        check(max(wall, page) < limit * slack, told[-1])

    def back(victim):
        cell = cell_of(victim)
        took = plant.wait(f"{cell} back", lambda wall: wall[cell]["state"] in ALIVE, BACK_ON_WALL_S * slack)
        told.append(f"the cell that was {victim}: back after {took:.1f} s")

    begin = time.monotonic()
    signal_all(victims["killed"], signal.SIGSTOP)
    signal_all(victims["killed"], signal.SIGKILL)
    known("killed", "killed", KILLED_IS_KNOWN_S, begin)
    begin = time.monotonic()
    signal_all(victims["stopped"], signal.SIGSTOP)
    known("stopped", "stopped", CUT_IS_KNOWN_S, begin)
    if "cut" in victims:
        begin = time.monotonic()
        plant.hosts.cut()
        known("cut", "cut off", CUT_IS_KNOWN_S, begin)
    plant.picture("harmed")
    signal_all(victims["stopped"], signal.SIGCONT)
    back("stopped")
    if "cut" in victims:
        plant.hosts.mend()
        back("cut")
    return told


def judge(plant, name, run, begun):
    """The books of a computer's run: what its detectors judged, what was lost, and how late it ended [s]."""
    code, summary = run.end(plant.args.seconds * 2 + 120)
    late = time.monotonic() - begun - plant.args.seconds
    lost = balance(summary)
    check(code == (3 if lost else 0), name, "ended with", code, "and lost", lost)
    whole = plant.args.seconds * plant.args.rate_hz
    for stage in summary["stages"]:
        if not stage["stage"].startswith("tell_"):
            check(abs(stage["emitted"] - whole) <= 2, stage, "of", whole)
    judged = sum(stage["emitted"] for stage in summary["stages"] if stage["stage"].startswith("detect_"))
    return judged, lost, late


def contacts(plant, cells):
    """The fleet host has kept every contact that the cells say they have had."""
    wall = plant.wall()
    told = {cell: wall[cell]["status"]["contacts_today"] for cell in cells}
    with sqlite3.connect(plant.folder / "fleet.sqlite") as store:
        kept = dict(store.execute("select cell, count(*) from contacts group by cell"))
    for cell, count in told.items():
        check(kept.get(cell, 0) == count, cell, "had", count, "contacts, kept are", kept.get(cell, 0))
        check((count > 0) == is_touched(cell), cell, "had", count, "contacts")
    return sum(told.values())


class Bystanders:
    """The cells that nobody harms: whether the wall ever says otherwise, and what all of it costs."""

    def __init__(self, plant, cells, run):
        self.plant, self.cells = plant, cells
        self.parts = {"cells": run.process.pid, "fleet host": plant.fleet.pid, "router": plant.router.pid}
        self.before = {name: computing_s(process) for name, process in self.parts.items()}
        self.since, self.load, self.oldest_ms, self.wrong = time.monotonic(), [], 0, []
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.follow)
        self.thread.start()

    def follow(self):
        while not self.over.is_set():
            wall = self.plant.wall()
            at = f"{time.monotonic() - self.since:.0f} s"
            for view in (wall[cell] for cell in self.cells):
                if view["state"] not in ALIVE:
                    self.wrong.append((at, view["cell"], view["state"], view.get("why"), view["status_age_ms"]))
            self.oldest_ms = max(self.oldest_ms, *(wall[cell]["sample_age_ms"] or 0 for cell in self.cells))
            self.load.append(os.getloadavg()[0])
            self.over.wait(1.0)

    def end(self):
        """At this instant, before the cells end."""
        took = time.monotonic() - self.since
        for name, process in self.parts.items():
            cores = (computing_s(process) - self.before[name]) / took
            print(f"{name}: {cores:.2f} cores, {memory_mb(process):.0f} MB", flush=True)
        self.stop()
        check(not self.wrong, "cells that nobody harmed:", self.wrong)
        print(f"load of the machine {min(self.load):.1f} to {max(self.load):.1f}; no sample older than {self.oldest_ms} ms "
              "on the wall", flush=True)

    def stop(self):
        self.over.set()
        self.thread.join()


def plant_of(program, folder, args, slack):
    plant = Plant(program, folder, args)
    try:
        print(f"{args.cells} cells at {args.rate_hz} Hz for {args.seconds} s, router: {plant.router_is}", flush=True)
        names = [f"cell_{number}" for number in range(args.cells - 3 if plant.hosts else args.cells - 2)]
        begin = time.monotonic()
        run = plant.run("all", names)
        victims = {name: plant.run(name, [name]) for name in ("killed", "stopped")}
        if plant.hosts:
            victims["cut"] = plant.run(
                "cut", ["cut"], plant.hosts.enter(0), f"tcp/{plant.hosts.addresses[1]}:{plant.port}")
        else:
            print("SKIPPED a cell that is cut off: network namespaces are not allowed", flush=True)
        everybody = [*names, *victims]
        plant.wait("all cells there", lambda wall: all(
            wall.get(cell, {}).get("state") in ALIVE for cell in everybody), 60 + args.cells)
        begun = time.monotonic()
        print(f"all on the wall after {begun - begin:.1f} s", flush=True)
        bystanders = Bystanders(plant, names, run)
        plant.ended.callback(bystanders.stop)
        time.sleep(min(20.0, args.seconds / 6))
        told = harm(plant, victims, slack)
        time.sleep(max(0.0, begin + args.seconds - 2 - time.monotonic()))
        bystanders.end()
        judged, lost, late = judge(plant, "the computer with all cells", run, begun)
        check(lost == 0, lost, "samples lost by cells that nobody harmed")
        check(late < LATE_S * slack, f"it ended {late:.1f} s late: the machine does not bear so many cells")
        survivors = [name for name in victims if name != "killed"]
        for name in survivors:
            _, lost, _ = judge(plant, name, victims[name], begun)
            check(lost == 0 or name == "stopped", lost, "samples lost by the cell that was", name)
            told.append(f"the cell that was {name}: {lost} samples not told, all counted")
        plant.wait("all ended", lambda wall: all(
            wall[cell]["state"] == "ended" for cell in [*names, *survivors]), 30)
        print("; ".join(told), flush=True)
        kept = contacts(plant, names)
        print(f"{judged} samples judged, 0 lost, {max(late, 0):.1f} s late; {kept} contacts told and kept", flush=True)
        document(plant)
    finally:
        plant.ended.close()


def document(plant):
    """A fleet host that comes later says in `--json` who is not there, and so does its exit code."""
    command = [plant.program, "fleet", "--json", "--connect", plant.router_at, "--expect", "killed"]
    done = subprocess.run(command, cwd=plant.folder, capture_output=True, text=True, check=False)
    wall = {view["cell"]: view["state"] for view in json.loads(done.stdout)["cells"]}
    check(done.returncode == 3 and wall["killed"] == "never_seen", done.returncode, wall, done.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--rate-hz", type=int, default=1000, help="25 or more: below that, touches are not felt")
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--processes", choices=["cell", "one"], default="cell")
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--short", action="store_true")
    args = parser.parse_args()
    if args.short:
        args.cells, args.rate_hz, args.seconds = 10, 100, 40
    # Each process has some dozen open files, of which the supervisor holds a part.
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    folder = Path(tempfile.mkdtemp(prefix="hundred_cells_"))
    try:
        plant_of(str(args.program.resolve()), folder, args, faults.BUSY if args.short else 1.0)
    except Failed as why:
        print(f"FAILED hundred_cells: {why}", flush=True)
        sys.exit(1)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
