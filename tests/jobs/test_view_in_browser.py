"""``rift view`` as a person sees it: a browser without a window opens the page, and is looked at.

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
from pathlib import Path

import numpy as np
import pytest

from rift_cl.io.image import read_image
from rift_cl.io.splat_scene import SplatScene
from rift_cl.jobs.camera_path import resized
from rift_cl.jobs.cameras.film import first_view
from rift_cl.jobs.scene_bounds import bounds_of_splats

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
from rift_cl.cli import main
sys.exit(main())
"""
# Red above the middle, the others round it: where neither panel nor notes are.
MEANS = np.array([[0, 0, 0], [0.6, 0, -0.5], [-0.6, 0, -0.5], [0, 0.5, -0.5], [0, -0.5, -0.5]])
COLORS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1]], float)
# Seconds until a page must show what it should, kernels compiled and all.
PATIENCE = 90
# Seconds until a browser must have answered.
ANSWER = 8

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium to look with"),
    pytest.mark.timeout(240),
]


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


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Five round splats of plain colours, nearly opaque."""
    folder = tmp_path_factory.mktemp("scene")
    scene = SplatScene(
        means=MEANS,
        log_scales=np.full((5, 3), np.log(0.12)),
        quats=np.tile([1.0, 0, 0, 0], (5, 1)),
        logit_opacities=np.full(5, 6.0),
        sh=((COLORS - 0.5) / 0.28209479177387814)[:, None, :],
    )
    scene.save(folder / "scene.ply")
    return scene, folder / "scene.ply"


@pytest.fixture(scope="module")
def served(scene):
    """The page's address, while ``rift view`` runs."""
    pytest.importorskip("viser", reason="viser is not installed")
    command = [sys.executable, "-c", RIFT, "view", str(scene[1])]
    command += ["--port", "0", "--size", "600", "--up", "0", "0", "1", "--background", *["0.5"] * 3]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        address = process.stdout.readline().split()[0]
        assert address.startswith("http://127.0.0.1:")
        yield address
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    finally:
        stop(process)
        process.stdout.close()


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A browser, which is gone afterwards with all that it started."""
    folder = tmp_path_factory.mktemp("browser")
    page = Page(folder)
    yield page
    page.do("Browser.close")
    page.socket.close()
    stop(page.process)
    assert not alive(str(folder))


def middles(picture):
    """Where each colour is seen, (x, y) by its number, where it is."""
    found = {}
    for number, color in enumerate(COLORS):
        near = np.abs(picture - color).max(axis=2) < 0.3
        if near.sum() > 20:
            found[number] = np.argwhere(near).mean(axis=0)[::-1] + 0.5
    return found


def expected(scene, size):
    """Where our own camera sees the splats in a window of (height, width)."""
    camera = resized(first_view(bounds_of_splats(scene))[0], size)
    local = scene.means @ camera.view[:3, :3].T + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return local[:, :2] / local[:, 2:] * (fx, fy) + (cx, cy)


def settled(page, folder, wanted):
    """The picture, once it is as it should be and stays so: a page fades from white into it."""
    before = None

    def look():
        nonlocal before
        last, before = before, page.picture(folder)
        still = last is not None and before is not None and np.array_equal(last, before)
        if not (still and wanted(middles(before))):
            return None
        # The corner far from the panel is background; the fade may stand still on a busy machine.
        return [before] if abs(before[-40, 40] - 0.5).max() < 0.03 else None

    return until(look, PATIENCE)[0]


def test_splats_are_seen_where_they_should_be_and_so_after_a_move_and_a_reload(
    served, page, scene, tmp_path
):
    page.do("Page.enable")
    page.do("Page.navigate", url=served)
    picture = settled(page, tmp_path, lambda found: len(found) >= 4)
    places, seen = expected(scene[0], picture.shape[:2]), middles(picture)
    for number, place in seen.items():
        np.testing.assert_allclose(place, places[number], atol=8)

    page.drag((250, 340), (350, 340))
    moved = settled(page, tmp_path, lambda found: 1 in found and abs(found[1] - seen[1]).max() > 15)
    turned = middles(moved)
    # The camera turns about the upright axis through the middle, on which red stays in place.
    assert 0 in turned and len(turned) >= 4
    np.testing.assert_allclose(turned[0], seen[0], atol=10)

    page.do("Page.reload")
    again = settled(page, tmp_path, lambda found: 1 in found and abs(found[1] - seen[1]).max() < 8)
    assert len(middles(again)) == len(seen)
