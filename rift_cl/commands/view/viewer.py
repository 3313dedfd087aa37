"""A window in the browser onto splats that somebody owns: ``rift view``, or a fit in progress.

viser (https://viser.studio) serves the page and tells where its camera is. Where a camera rests,
the picture is drawn by our own kernels and sent as the page's background, so that the browser shows
what ``Renderer`` draws; while it moves, a browser may draw plain splats by itself. A trainer
changes its splats in place, so nothing is ever drawn from viser's threads: they note what is asked
for, and the owner of the splats draws it when it calls ``serve``.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view.browser_splats import MovingSplats
from rift_cl.commands.view.crop import Crop
from rift_cl.commands.view.page import ViewerPage, sending
from rift_cl.commands.view.photographs import Photograph, nearest_one
from rift_cl.commands.view.picture import Painter
from rift_cl.commands.view.pose import NARROWEST, Pose
from rift_cl.commands.view.standpoint import standpoint_of
from rift_cl.commands.view.wish import KINDS, Kind, Wish
from rift_cl.errors import InputError, RiftError
from rift_cl.geometry import Camera
from rift_cl.io.images.display_light import LightKind
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

# Seconds that a picture of a moving camera should take, and that one of half the size may take.
_PICTURE, _SLOW = 0.05, 0.25
# The least longer edge of a picture, and how many sizes there are up to the full one.
_LEAST, _SIZES = 96, 8


class Pace:
    """How many pixels are drawn and sent in a second; None before the first picture."""

    def __init__(self) -> None:
        self.pixels: float | None = None

    def learn(self, pixels: int, seconds: float) -> None:
        """Note what a picture took; one that had to wait for something else says little."""
        now = pixels / seconds
        self.pixels = now if self.pixels is None else math.sqrt(now * self.pixels)

    def edge(self, pose: Pose, full: int) -> int:
        """The longer edge in pixels at which a moving camera's picture is drawn in time.

        At least half of what it is at rest, unless that took all too long; in few steps, since a
        picture that changes its size all the time flickers.

        Args:
            pose: whose window has a shape.
            full: the longer edge at rest.
        """
        if self.pixels is None:
            return min(full, max(_LEAST, full // 2))
        share = max(min(pose.aspect, 1 / pose.aspect), NARROWEST)
        soon, late = (math.sqrt(self.pixels * limit / share) for limit in (_PICTURE, _SLOW))
        step = full / _SIZES
        fits = max(step * int(soon / step), min(full / 2, late))
        return min(full, max(_LEAST, int(fits)))


# Seconds without a move after which a camera rests.
_REST = 0.2
# Pictures of a fit whose page rests are so many times their own length apart.
_BETWEEN = 4.0
# Quality of JPEG while the camera moves and while it rests.
_ROUGH, _SHARP = 70, 92
# Seconds after which a browser has surely decoded and shown a picture.
_SEEN = 0.2
# Width divided by height of a window in which all of the first view is seen.
_ASPECT = 4 / 3


@dataclass
class _Client:
    """A page that is open.

    Args:
        handle: viser's.
        pose: the newest.
        since: when that came.
        rough: what the last picture was drawn for.
        sharp: what the last one of full size was drawn for.
        again: when a fit's next picture is due.
        splats: what the page may draw by itself, and the box that they were cropped to.
        alone: whether it does.
        ends: when the picture that was sent is surely seen, so that it need not any more.
    """

    handle: Any
    pose: Pose
    since: float
    rough: Any = None
    sharp: Any = None
    again: float = 0.0
    splats: tuple[Any, Crop | None] | None = None
    alone: bool = False
    ends: float = math.inf


class SplatViewer:
    """A page on this computer alone; use it in a ``with`` statement, or ``close`` it.

    Args:
        bounds: what the camera turns about, and which way is up.
        photographs: that may be jumped to; the page opens where one of them was taken.
        moving: what a browser draws while its camera moves; our kernels do if not given.
        port: to listen on, at 127.0.0.1; 0 for any that is free.
        size: longer edge in pixels of a picture whose camera rests.
        background: (3,) behind the splats, in their light; black if not given.
        light: that the splats' colours are in.
        title: above the panel.
        kinds: of pictures that a page can ask for.

    Raises:
        InputError: viser is not installed, or the port cannot be had.
    """

    def __init__(
        self,
        bounds: SceneBounds,
        *,
        photographs: Sequence[Photograph] = (),
        moving: MovingSplats | None = None,
        port: int = 8080,
        size: int = 960,
        background: ArrayLike | None = None,
        light: LightKind = "display",
        title: str = "RiFT",
        kinds: Sequence[Kind] = KINDS,
    ) -> None:
        behind = np.zeros(3) if background is None else background
        self._background = np.asarray(behind, np.float32)
        self._painter = Painter(self._background, light, bounds)
        self._moving = moving
        self._clients: dict[int, _Client] = {}
        self._lock, self._asked = threading.Lock(), threading.Event()
        self._splats: Splats | None = None
        self._version = 0
        self._pace = Pace()
        self.state, self._wish = "", Wish(edge=size)
        first, target = first_view(bounds)
        self._page = ViewerPage(
            port=port,
            size=size,
            title=title,
            bounds=bounds,
            first=standpoint_of(first, target, bounds.up, _ASPECT),
            photographs=photographs,
            number=nearest_one(photographs, first),
            moving=moving is not None,
            kinds=kinds,
            asked=self._asked.set,
        )
        self._page.watch(self._joined, self._moved, self._left)

    @property
    def url(self) -> str:
        """Where the page is."""
        return self._page.url

    def serve(self, splats: Splats, renderer: Renderer, *, changed: bool = False) -> int:
        """Draw what is asked for now and send it; call it from the thread that owns the splats.

        Costs nothing where nobody looks. A page whose camera moves gets a smaller picture at
        once, and one of full size when it rests.

        Args:
            splats: to draw, on the renderer's device.
            renderer: draws them.
            changed: the splats have changed since the last call though they are the same object,
                so that pages whose camera rests want a new picture.

        Returns:
            How many pictures were drawn.
        """
        if changed or splats is not self._splats:
            self._splats, self._version = splats, self._version + 1
        self._asked.clear()
        with self._lock:
            clients = list(self._clients.values())
        return sum(self._serve_one(client, splats, renderer) for client in clients)

    def wait(self, seconds: float) -> None:
        """Sleep until a page asks for something, but not longer than this."""
        self._asked.wait(seconds)

    def close(self) -> None:
        """Stop serving; pages that are open stay as they are."""
        self._page.close()

    def __enter__(self) -> SplatViewer:
        """The viewer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def _serve_one(self, client: _Client, splats: Splats, renderer: Renderer) -> bool:
        """Draw for one page if it wants anything that it does not have."""
        # A page may set its panels to anything; what makes no sense is as if it were not said.
        with suppress(Exception):
            self._wish = self._page.wish
        pose, since, wish = client.pose, client.since, self._wish
        want, now = (pose, wish, self._version), time.monotonic()
        resting = now - since >= _REST
        self._lend(client, wish.crop, now)
        if client.alone and not resting:
            return False
        if want == client.sharp or (want == client.rough and not resting):
            return False
        # Nothing but the splats has changed: a fit shall not wait for its pictures all the time.
        waits = client.sharp is not None and want[:2] == client.sharp[:2]
        if waits and now < client.again:
            return False
        small = wish.edge if resting else self._pace.edge(pose, wish.edge)
        try:
            camera = pose.camera(small)
        except InputError:
            # What a page says is not ours to trust, and no reason to end a fit.
            return False
        begin, before = time.perf_counter(), self._painter.drawn
        try:
            picture = self._painter.paint(splats, renderer, camera, wish, self._version)
        except RiftError as error:
            # Too large for the memory, say: the panel can be set to something else.
            self._page.tell(f"this cannot be drawn: {error}")
            client.rough = client.sharp = want
            return False
        quality = _ROUGH if small < wish.edge else _SHARP
        self._page.show(client.handle, picture, quality)
        seconds = time.perf_counter() - begin
        if self._painter.drawn > before:
            self._pace.learn(camera.height * camera.width, seconds)
        client.rough, client.sharp = want, None
        if small == wish.edge:
            now = time.monotonic()
            client.sharp, client.again = want, now + _BETWEEN * seconds
            with self._lock:
                client.ends = now + _SEEN if client.pose is pose else math.inf
            self._page.tell(self._facts(splats, camera, seconds))
        return True

    def _lend(self, client: _Client, crop: Crop | None, now: float) -> None:
        """Give a page the splats that it draws by itself, or hide them once our picture is seen."""
        if self._moving is None:
            return
        with sending():
            if client.splats is None or client.splats[1] != crop:
                client.splats, client.alone = (self._moving.give(client.handle, crop), crop), False
        with self._lock, sending():
            if client.splats is not None and client.alone and now >= client.ends:
                client.splats[0].visible = client.alone = False

    def _facts(self, splats: Splats, camera: Camera, seconds: float) -> str:
        """What the panel says, in plain lines."""
        arrays = [array for array in vars(splats).values() if array is not None]
        megabytes = sum(array.nbytes for array in arrays) / 2**20
        lines = [
            f"{len(splats)} splats, {megabytes:.1f} MiB",
            f"{camera.width} x {camera.height} pixels in {1000 * seconds:.0f} ms",
            f"{1 / max(seconds, 1e-6):.3g} pictures a second",
            *filter(None, [self.state, self._painter.trouble]),
        ]
        return "\n".join(lines)

    def _joined(self, handle: Any, pose: Pose) -> None:
        with self._lock:
            # A page that has just opened does not move.
            since = time.monotonic() - _REST
            self._clients[handle.client_id] = _Client(handle, pose, since)
        self._asked.set()

    def _moved(self, number: int, pose: Pose) -> None:
        with self._lock:
            client = self._clients.get(number)
            if client is not None and client.pose != pose:
                client.pose, client.since = pose, time.monotonic()
                client.ends = math.inf
                if client.splats is not None and not client.alone and self._page.hands_over:
                    client.alone, client.sharp = True, None
                    self._page.hand_over(client.handle, client.splats[0], self._background)
        self._asked.set()

    def _left(self, number: int) -> None:
        with self._lock:
            self._clients.pop(number, None)
