#!/usr/bin/env python3
"""A thousand cells that tell their fleet status and contacts, through one router: who goes is known at once.

    tests/faults/thousand_cells.py PROGRAM CELLS_PROGRAM [--cells 1000] [--rate-hz 100] [--seconds 600]
                                   [--pictures FOLDER]

PROGRAM is the built tauscope, CELLS_PROGRAM `many_cells` (`cargo build --release -p tauscope-publish --example
many_cells`): the publishers of many cells in one process, each with a session of its own, told made-up samples.
Meanwhile one cell is killed, one is cut off from the network, one is stopped. Router and fleet host are those of
`hundred_cells.py`, and so is what is demanded of the wall.
"""
import argparse
import json
import resource
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from faults import Failed, check
from hundred_cells import Bystanders, Plant, document, harm

# The publishers tell the wall so late at most.
LATE_MS = 1000


class Told:
    """A process of cells."""

    def __init__(self, plant, prefix, count, seconds, into=(), router=None):
        command = [*into, plant.args.cells_program.resolve(), router or plant.router_at, prefix, count,
                   plant.args.rate_hz, seconds]
        self.names = [f"{prefix}{number}" for number in range(count)]
        self.process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True)
        # As of a run: the processes beside it.
        self.ids = {}
        plant.ended.callback(self.process.wait)
        plant.ended.callback(self.process.kill)

    def end(self):
        out = self.process.communicate(timeout=600)[0]
        check(self.process.returncode == 0, "the cells ended with", self.process.returncode)
        return json.loads(out)


class Thousand(Plant):
    def record(self):
        """Nothing is recorded: the samples are made up."""


def judge(plant, run, said):
    check(said["unsent"] == 0, said["unsent"], "messages could not be sent")
    check(said["late_ms"] < LATE_MS, "the cells were", said["late_ms"], "ms late: the machine does not bear so many")
    wall = plant.wall()
    with sqlite3.connect(plant.folder / "fleet.sqlite") as store:
        kept = dict(store.execute("select cell, count(*) from contacts group by cell"))
    for cell, count in said["contacts"].items():
        check(wall[cell]["status"]["contacts_today"] == count, cell, "had", count, "contacts, the wall says", wall[cell])
        check(kept.get(cell, 0) == count, cell, "had", count, "contacts, kept are", kept.get(cell, 0))
    return sum(said["contacts"].values())


def plant_of(program, folder, args):
    plant = Thousand(program, folder, args)
    try:
        print(f"{args.cells} cells at {args.rate_hz} Hz for {args.seconds} s, router: {plant.router_is}", flush=True)
        begin = time.monotonic()
        victims = {}
        for name in ("killed", "stopped"):
            victims[name] = Told(plant, name, 1, args.seconds + 60)
        if plant.hosts:
            victims["cut"] = Told(plant, "cut", 1, args.seconds + 60, plant.hosts.enter(0),
                                  f"tcp/{plant.hosts.addresses[1]}:{plant.port}")
        else:
            print("SKIPPED a cell that is cut off: network namespaces are not allowed", flush=True)
        run = Told(plant, "cell_", args.cells - len(victims), args.seconds)
        everybody = [*run.names, *(f"{name}0" for name in victims)]
        plant.wait("all cells there", lambda wall: all(
            wall.get(cell, {}).get("state") in ("running", "contact", "not_ready") for cell in everybody), 300)
        begun = time.monotonic()
        print(f"all on the wall after {begun - begin:.1f} s", flush=True)
        bystanders = Bystanders(plant, run.names, run)
        plant.ended.callback(bystanders.stop)
        time.sleep(min(20.0, args.seconds / 6))
        told = harm(plant, victims, 1.0, lambda name: f"{name}0")
        plant.picture("thousand")
        time.sleep(max(0.0, begun + args.seconds - 20 - time.monotonic()))
        bystanders.end()
        kept = judge(plant, run, said := run.end())
        print("; ".join(told), flush=True)
        print(f"{said['told']} samples told, 0 messages lost, {said['late_ms']} ms late at most; {kept} contacts told "
              "and kept", flush=True)
        document(plant)
    finally:
        plant.ended.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("cells_program", type=Path)
    parser.add_argument("--cells", type=int, default=1000)
    parser.add_argument("--rate-hz", type=int, default=100)
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--pictures", type=Path)
    args = parser.parse_args()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    folder = Path(tempfile.mkdtemp(prefix="thousand_cells_"))
    try:
        plant_of(str(args.program.resolve()), folder, args)
    except Failed as why:
        print(f"FAILED thousand_cells: {why}", flush=True)
        sys.exit(1)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
