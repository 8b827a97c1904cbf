"""Network namespaces as machines."""
import os
import shutil
import signal
import subprocess


class Skipped(Exception):
    """The machine does not allow it."""


class Hosts:
    """Two network namespaces joined by a veth pair; `alone`, the second host is this one."""

    def __init__(self, alone=False):
        number = os.getpid()
        self.names = [f"ts_fault_{side}_{number}" for side in ("a" if alone else "ab")]
        self.ends = [f"tsf{side}{number}" for side in "ab"]
        # Scripts that run at the same time must not meet on this machine.
        self.addresses = [f"10.231.{number % 250}.{place + 1}" for place in range(2)]
        if not shutil.which("ip"):
            raise Skipped("network namespaces need `ip`")
        for name in self.names:
            self.ip("netns", "add", name)
        self.ip("link", "add", self.ends[0], "netns", self.names[0], "type", "veth", "peer", "name", self.ends[1],
                *(() if alone else ("netns", self.names[1])))
        for place, end in enumerate(self.ends):
            there = ("-n", self.names[place]) if place < len(self.names) else ()
            self.ip(*there, "address", "add", f"{self.addresses[place]}/24", "dev", end)
            self.ip(*there, "link", "set", "lo", "up")
            self.ip(*there, "link", "set", end, "up")

    def ip(self, *words):
        done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
        if done.returncode:
            self.close()
            raise Skipped(f"ip {' '.join(words)}: {done.stderr.strip()}")

    def cut(self):
        self.ip("-n", self.names[0], "link", "set", self.ends[0], "down")

    def mend(self):
        self.ip("-n", self.names[0], "link", "set", self.ends[0], "up")

    def kill(self, place):
        """All processes of a host die at once."""
        done = subprocess.run(["ip", "netns", "pids", self.names[place]], capture_output=True, text=True, check=False)
        for process in done.stdout.split():
            os.kill(int(process), signal.SIGKILL)

    def enter(self, place):
        return ["ip", "netns", "exec", self.names[place]]

    def close(self):
        # A namespace whose processes still end keeps its interfaces for a while.
        subprocess.run(["ip", "link", "delete", self.ends[1]], capture_output=True, check=False)
        for name in self.names:
            subprocess.run(["ip", "netns", "delete", name], capture_output=True, check=False)
