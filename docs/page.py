"""Takes a picture of a web page as Chromium shows it, of any width and in either colour scheme.

    page.py ADDRESS PICTURE.png WIDTH [light|dark] [HEIGHT]

Without HEIGHT the whole page is taken. Says on standard error if the page is wider than WIDTH, and ends with 1 then.
Drives the browser over its pipe (Chrome DevTools Protocol), because a window is never narrower than 500 pixels.
"""
import base64
import json
import os
import subprocess
import sys
import time


class Browser:
    """A browser without a window."""

    def __init__(self):
        ours, theirs = os.pipe(), os.pipe()

        def pipes():
            # Copies first: 3 and 4 may be among the pipes.
            read, write = os.dup(ours[0]), os.dup(theirs[1])
            os.dup2(read, 3)
            os.dup2(write, 4)

        self.process = subprocess.Popen(
            ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars", "--remote-debugging-pipe"],
            preexec_fn=pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(ours[0])
        os.close(theirs[1])
        self.to, self.back, self.requests, self.session = ours[1], os.fdopen(theirs[0], "rb"), 0, None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    def call(self, method, **parameters):
        self.requests += 1
        message = {"id": self.requests, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while True:
            answer = json.loads(self.read())
            if answer.get("id") == self.requests:
                if "error" in answer:
                    sys.exit(f"{method}: {answer['error']['message']}")
                return answer["result"]

    def read(self):
        text = bytearray()
        while not text.endswith(b"\0"):
            byte = self.back.read(1)
            if not byte:
                sys.exit("the browser ended")
            text += byte
        return text[:-1]

    def evaluate(self, expression):
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")


def main(address, picture, width, scheme="light", height=None):
    width = int(width)
    browser = Browser()
    try:
        browser.call("Emulation.setDeviceMetricsOverride", width=width, height=int(height or 900),
                     deviceScaleFactor=1, mobile=width < 500)
        browser.call("Emulation.setEmulatedMedia",
                     features=[{"name": "prefers-color-scheme", "value": scheme}])
        browser.call("Page.enable")
        browser.call("Page.navigate", url=address)
        end = time.monotonic() + 20
        while browser.evaluate("document.readyState") != "complete" and time.monotonic() < end:
            time.sleep(0.1)
        # What the page is told when it is there.
        time.sleep(1.5)
        wide = browser.evaluate("document.documentElement.scrollWidth")
        shot = {"captureBeyondViewport": True, "format": "png"}
        shot["clip"] = {"x": 0, "y": 0, "width": width, "height": int(height or 900), "scale": 1}
        if height is None:
            tall = browser.evaluate("document.documentElement.scrollHeight")
            shot["clip"]["height"] = tall
        with open(picture, "wb") as file:
            file.write(base64.b64decode(browser.call("Page.captureScreenshot", **shot)["data"]))
    finally:
        browser.process.terminate()
        browser.process.wait(10)
    if wide > width:
        sys.exit(f"{address} is {wide} pixels wide, not {width}")


main(*sys.argv[1:])
