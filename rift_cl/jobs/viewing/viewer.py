"""A window in the browser onto splats that somebody owns: ``rift view``, or a fit in progress.

viser (https://viser.studio) serves the page and tells where its camera is; every picture is drawn
by our own kernels and sent as the page's background, so that the browser shows what ``Renderer``
draws. A trainer changes its splats in place, so nothing is ever drawn from viser's threads: they
note what is asked for, and the owner of the splats draws it when it calls ``serve``.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.jobs.cameras.film import first_view
from rift_cl.jobs.fit_pictures import Light
from rift_cl.jobs.scene_bounds import SceneBounds
from rift_cl.jobs.viewing.page import ViewerPage
from rift_cl.jobs.viewing.photographs import Photograph, nearest_one
from rift_cl.jobs.viewing.picture import Painter
from rift_cl.jobs.viewing.pose import NARROWEST, Pose
from rift_cl.jobs.viewing.standpoint import standpoint_of
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

# A camera rests when it has not moved for so many seconds; until then a picture may take so long.
_REST, _PICTURE = 0.2, 0.06
# Longer edge of a picture while nobody knows how fast they are drawn, and the least there is.
_FIRST, _LEAST = 240, 96
# Pictures of a fit whose page rests are so many times their own length apart.
_BETWEEN = 4.0
# Quality of JPEG while the camera moves and while it rests.
_ROUGH, _SHARP = 70, 92
# Width divided by height of a window in which all of the first view is seen.
_ASPECT = 4 / 3


@dataclass
class _Client:
    """A page that is open: its newest pose, when that came, what it was sent, and when again."""

    handle: Any
    pose: Pose
    since: float
    rough: Any = None
    sharp: Any = None
    again: float = 0.0


class SplatViewer:
    """A page on this computer alone; use it in a ``with`` statement, or ``close`` it.

    Args:
        bounds: what the camera turns about, and which way is up.
        photographs: that may be jumped to; the page opens where one of them was taken.
        port: to listen on, at 127.0.0.1; 0 for any that is free.
        size: longer edge in pixels of a picture whose camera rests.
        background: (3,) behind the splats, in their light; black if not given.
        light: that the splats' colours are in.
        title: above the panel.

    Raises:
        InputError: viser is not installed, or the port cannot be had.
    """

    def __init__(
        self,
        bounds: SceneBounds,
        *,
        photographs: Sequence[Photograph] = (),
        port: int = 8080,
        size: int = 960,
        background: ArrayLike | None = None,
        light: Light = "display",
        title: str = "RiFT",
    ) -> None:
        behind = np.zeros(3) if background is None else background
        self._painter = Painter(np.asarray(behind, np.float32), light, bounds)
        self._clients: dict[int, _Client] = {}
        self._lock, self._asked = threading.Lock(), threading.Event()
        self._splats: Splats | None = None
        self._version = 0
        # Pixels in a second, as the last picture was drawn and sent.
        self._pace: float | None = None
        self.state = ""
        first, target = first_view(bounds)
        self._page = ViewerPage(
            port=port,
            size=size,
            title=title,
            bounds=bounds,
            first=standpoint_of(first, target, bounds.up, _ASPECT),
            photographs=photographs,
            number=nearest_one(photographs, first),
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
        pose, since, wish = client.pose, client.since, self._page.wish
        want = (pose, wish, self._version)
        resting = time.monotonic() - since >= _REST
        if want == client.sharp or (want == client.rough and not resting):
            return False
        # Nothing but the splats has changed: a fit shall not wait for its pictures all the time.
        waits = client.sharp is not None and want[:2] == client.sharp[:2]
        if waits and time.monotonic() < client.again:
            return False
        small = wish.edge if resting else self._small(pose, wish.edge)
        try:
            camera = pose.camera(small)
        except InputError:
            # What a page says is not ours to trust, and no reason to end a fit.
            return False
        begin = time.perf_counter()
        picture = self._painter.paint(splats, renderer, camera, wish, self._version)
        quality = _ROUGH if small < wish.edge else _SHARP
        self._page.show(client.handle, picture, quality)
        seconds = time.perf_counter() - begin
        self._pace = camera.height * camera.width / seconds
        client.rough = want
        if small == wish.edge:
            client.sharp, client.again = want, time.monotonic() + _BETWEEN * seconds
            self._page.tell(self._facts(splats, camera, seconds))
        return True

    def _facts(self, splats: Splats, camera: Camera, seconds: float) -> str:
        """What the panel says: lines of Markdown."""
        arrays = [array for array in vars(splats).values() if array is not None]
        megabytes = sum(array.nbytes for array in arrays) / 2**20
        lines = [
            f"{len(splats)} splats, {megabytes:.1f} MiB",
            f"{camera.width} x {camera.height} pixels in {1000 * seconds:.0f} ms",
            f"{1 / max(seconds, 1e-6):.3g} pictures a second",
            *filter(None, [self.state]),
        ]
        return "  \n".join(lines)

    def _small(self, pose: Pose, edge: int) -> int:
        """The longer edge at which a picture is drawn in time, while the camera moves."""
        if self._pace is None:
            return min(edge, _FIRST)
        share = min(pose.aspect, 1 / pose.aspect)
        fits = int(np.sqrt(self._pace * _PICTURE / max(share, NARROWEST)))
        return min(edge, max(_LEAST, fits))

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
        self._asked.set()

    def _left(self, number: int) -> None:
        with self._lock:
            self._clients.pop(number, None)
