"""A browser without a window that opens a viewer's page, is told what to do, and is looked at.

Chromium is told what to do through its DevTools protocol, over the websockets that viser brings.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from rift_cl.io.images.image import read_image

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = (
    *("--headless=new", "--no-sandbox", "--no-first-run", "--disable-crash-reporter"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-gpu", "--enable-unsafe-swiftshader"),
    *("--window-size=1100,520", "--remote-debugging-port=0", "--remote-allow-origins=*"),
)
# The command line; a shell's background jobs ignore Ctrl-C, and so would what they start.
RIFT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from rift_cl.commands.cli import main
sys.exit(main())
"""
# Seconds until a browser must have answered.
ANSWER = 8


class Page:
    """A tab of a browser: commands in, answers out."""

    def __init__(self, folder: Path) -> None:
        from websockets.sync.client import connect

        command = [CHROMIUM, *FLAGS, f"--user-data-dir={folder}", "about:blank"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen(command, start_new_session=True, **quiet)
        try:
            port = until(lambda: (folder / "DevToolsActivePort").read_text().split()[0], 60)
            address = f"http://127.0.0.1:{port}/json"
            tab = next(t for t in fetched(address) if t["type"] == "page")
            self.socket = connect(tab["webSocketDebuggerUrl"], max_size=None, open_timeout=30)
        except BaseException:
            stop(self.process)
            raise
        self.number = 0

    def do(self, method, **values):
        """Send a command and wait for its answer, empty if it failed; events are left alone."""
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": values}))
        # A picture that is asked for while pages change may never come; it is asked for again.
        end = time.monotonic() + ANSWER
        while True:
            answer = json.loads(self.socket.recv(timeout=max(0, end - time.monotonic())))
            if answer.get("id") == self.number:
                return answer.get("result", {})

    def picture(self, folder):
        """What the window shows, (height, width, 3); None while it changes from page to page."""
        answer, path = self.do("Page.captureScreenshot"), folder / "seen.png"
        if "data" not in answer:
            return None
        path.write_bytes(base64.b64decode(answer["data"]))
        return read_image(path)[..., :3]

    def drag(self, start, end):
        """Pull the scene from one place to another, which turns it."""
        mouse = {"button": "left", "clickCount": 1}
        self.do("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], **mouse)
        for way in np.linspace(0, 1, 8):
            x, y = np.add(start, way * np.subtract(end, start)).tolist()
            self.do("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, buttons=1, **mouse)
        self.do("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], **mouse)


def fetched(address):
    with urllib.request.urlopen(address, timeout=10) as answer:
        return json.load(answer)


def until(found, seconds):
    """What a function gives, once it neither raises nor gives nothing."""
    end = time.monotonic() + seconds
    while True:
        try:
            value = found()
        except (OSError, IndexError):
            value = None
        if value:
            return value
        assert time.monotonic() < end, f"nothing came in {seconds} s"
        time.sleep(0.2)


def stop(process):
    """End a process and all that it started."""
    for how in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, how)
        except ProcessLookupError:
            break
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            continue
    process.wait(10)


def alive(word):
    """Command lines of processes that name something."""
    lines = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            lines.append(path.read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        except OSError:
            continue
    return [line for line in lines if word in line]


@contextmanager
def opened(folder):
    """A browser, which is gone afterwards with all that it started."""
    page = Page(folder)
    try:
        yield page
        page.do("Browser.close")
        page.socket.close()
    finally:
        stop(page.process)
    # What the browser started ends a moment after it.
    until(lambda: not alive(str(folder)), 30)


@contextmanager
def command(*arguments, status=0):
    """The line of output with the address, while a command runs; Ctrl-C ends it."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen(
        [sys.executable, "-c", RIFT, *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        lines = iter(process.stdout.readline, "")
        yield next(line.split()[0] for line in lines if line.startswith("http://127.0.0.1:"))
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        assert process.wait(20) == status
    finally:
        stop(process)
        process.stdout.close()
