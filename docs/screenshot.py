"""Opens a recording in a headless Rerun viewer, sets the time and saves what is seen.

    screenshot.py RECORDING.rrd PICTURE.png SECONDS [TIMELINE]

Drives the viewer over its Model Context Protocol server, which comes with it. See screenshot.sh.
"""
import io
import json
import os
import pathlib
import subprocess
import sys
import time

from PIL import Image
import rerun_cli

WIDTH, HEIGHT, TITLE_BAR = 1600, 1000, 29
PORT = 9917
# The other is `recording_time`, of an explanation.
TIMELINE = sys.argv[4] if len(sys.argv) > 4 else "ros2_timestamp"
# The binary itself: the `rerun` beside it in the venv is a wrapper that does not pass on a signal.
RERUN = str(pathlib.Path(rerun_cli.__file__).with_name("rerun"))


class Viewer:
    """A viewer without a window, and a channel to steer it."""

    def __init__(self, recording):
        quiet = {**os.environ, "RUST_LOG": "off"}
        arguments = ["--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(PORT)]
        self.process = subprocess.Popen(
            [RERUN, *arguments, recording], env=quiet, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        self.control = subprocess.Popen(
            [RERUN, "viewer-mcp"], env=quiet, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.requests = 0
        client = {"name": "screenshot", "version": "1"}
        self.request("initialize", {"protocolVersion": "2024-11-05", "capabilities": {}, "clientInfo": client})
        self.send({"method": "notifications/initialized"})

    def send(self, message):
        self.control.stdin.write(json.dumps({"jsonrpc": "2.0", **message}) + "\n")
        self.control.stdin.flush()

    def request(self, method, parameters):
        self.requests += 1
        self.send({"id": self.requests, "method": method, "params": parameters})
        for line in self.control.stdout:
            answer = json.loads(line)
            if answer.get("id") == self.requests:
                return answer
        sys.exit("the viewer's control ended")

    def call(self, tool, **arguments):
        """Calls a tool; what it says, or None if it failed."""
        result = self.request("tools/call", {"name": tool, "arguments": arguments}).get("result", {})
        return None if result.get("isError", True) else result["content"][0].get("text", "")

    def must(self, tool, **arguments):
        said = self.call(tool, **arguments)
        if said is None:
            sys.exit(f"the viewer refused `{tool}`")
        return said

    def wait(self, ready, seconds, what):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.process.poll() is not None:
                sys.exit(f"the viewer ended: {self.process.stderr.read().decode().strip()}")
            if ready():
                return
            time.sleep(0.2)
        sys.exit(f"{what} within {seconds} s")

    def close(self):
        for process in (self.control, self.process):
            process.terminate()
            process.wait(10)


def timeline(viewer):
    """Beginning and end of the recording [ns], once it is loaded."""
    for recording in json.loads(viewer.must("viewer_state"))["recordings"]:
        for entry in recording["timelines"]:
            if entry["timeline"] == TIMELINE:
                return int(entry["min"]), int(entry["max"])
    return None


def main(recording, picture, seconds):
    viewer = Viewer(recording)
    try:
        viewer.wait(lambda: viewer.call("connect", endpoint=f"http://127.0.0.1:{PORT}") is not None,
                    30, "the viewer did not start")
        viewer.must("resize", width=WIDTH, height=HEIGHT + TITLE_BAR)
        viewer.wait(lambda: timeline(viewer) is not None, 30, f"no timeline {TIMELINE} in the recording")
        # The layout stands at the end of the file.
        viewer.must("wait_for", min_steps=60)
        start, _ = timeline(viewer)
        viewer.must("set_time", timeline=TIMELINE, time=start + int(float(seconds) * 1e9))
        viewer.must("wait_for", min_steps=30)
        whole = pathlib.Path(picture).with_suffix(".whole.png")
        viewer.must("screenshot", save_path=str(whole))
    finally:
        viewer.close()
    # Without the window's own bar, which tells of the machine.
    image = Image.open(io.BytesIO(whole.read_bytes())).convert("RGB")
    image.crop((0, TITLE_BAR, image.width, image.height)).save(picture, optimize=True)
    whole.unlink()


main(*sys.argv[1:4])
