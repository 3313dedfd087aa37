"""The page that a viewer shows: viser's server, its panels, and where its cameras are.

viser prints where it listens and offers to share the page with the world through a server of its
own; neither is wanted here. What is spoken with viser is in this file and in the panels.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import socket
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view.crop_panel import CropPanel
from rift_cl.commands.view.guard import Guard
from rift_cl.commands.view.lens_panel import LensPanel
from rift_cl.commands.view.path_panel import PathPanel
from rift_cl.commands.view.photograph_panel import PhotographPanel
from rift_cl.commands.view.photographs import Photograph
from rift_cl.commands.view.pose import Pose
from rift_cl.commands.view.standpoint import Standpoint
from rift_cl.commands.view.view_panel import ViewPanel
from rift_cl.commands.view.viser_camera import pose_of
from rift_cl.commands.view.wish import KINDS, Kind, Wish
from rift_cl.errors import InputError, not_installed

_HOST = "127.0.0.1"
# How near and far what the browser draws may be, in distances of the first view.
_NEAR, _FAR = 1e-3, 1e4
SMALLEST, LARGEST = 64, 4096


class ViewerPage:
    """viser's server on this computer alone, with our panels.

    Args:
        port: to listen on; 0 for any that is free.
        size: longer edge in pixels that the panel begins with.
        title: above the panels.
        bounds: what is shown, and which way is up.
        first: where the camera of a page that is opened stands.
        photographs: that may be jumped to.
        number: of the photograph at which a page opens.
        moving: whether a browser can draw while its camera moves.
        kinds: of pictures that can be asked for.
        asked: called from viser's threads when a panel is changed.

    Raises:
        InputError: viser is not installed, or the port cannot be had.
    """

    def __init__(
        self,
        *,
        port: int,
        size: int,
        title: str,
        bounds: SceneBounds,
        first: Standpoint,
        photographs: Sequence[Photograph],
        number: int,
        moving: bool,
        kinds: Sequence[Kind],
        asked: Callable[[], None],
    ) -> None:
        if not SMALLEST <= size <= LARGEST:
            raise InputError(f"--size is {size}, wanted {SMALLEST} to {LARGEST} pixels")
        viser = _viser()
        _check_port(port)
        guard = Guard()
        with contextlib.redirect_stdout(io.StringIO()), guard.before_viser():
            self._server = viser.ViserServer(host=_HOST, port=port, label=title, verbose=False)
        # viser takes the next port that is free, which is not what was asked for.
        if port and self._server.get_port() != port:
            self._end()
            raise _taken(port)
        if not guard.asked:
            self._end()
            raise InputError("this viser cannot be guarded: pip install 'viser>=1.1,<1.2'")
        self.url = f"http://{_HOST}:{self._server.get_port()}/{guard.token}"
        # What a page sends may make viser's callbacks fail: its own loss, and nobody's concern.
        self._server.get_event_loop().set_exception_handler(lambda *_: None)
        # viser warns of it in words that the page has chosen: these belong on no terminal.
        warnings.filterwarnings("ignore", module="viser")
        warnings.filterwarnings("ignore", message=r"\[viser\]|Queued a \w+ on a closed connection")
        # A page may ask for a tunnel through a server on the internet, whatever it shows.
        self._server.request_share_url = lambda *_, **__: None
        self._server.disconnect_share_url = lambda *_, **__: None
        self._server.gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="small"
        )
        self._begin_at(first)
        self.view = ViewPanel(self._server, size, first, asked, moving=moving, kinds=kinds)
        reach = float(np.linalg.norm(first.target - first.position))
        opening = photographs[number].camera.aperture if photographs else None
        # What has no depth was taken through no lens.
        lens = "depth" in kinds
        self.lens = LensPanel(self._server, reach, opening, asked, visible=lens)
        given = (self._server, photographs, number, bounds, self.lens)
        self.photographs = PhotographPanel(*given, asked)
        self.crop = CropPanel(self._server, bounds, asked)
        self.path = PathPanel(self._server, self.lens, lambda: self.view.size)

    def _begin_at(self, first: Standpoint) -> None:
        """Where the camera of a page that is opened stands."""
        self._server.scene.set_up_direction(tuple(first.up.tolist()))
        camera = self._server.initial_camera
        camera.position = tuple(first.position.tolist())
        camera.look_at = tuple(first.target.tolist())
        camera.fov = first.fov
        reach = float(np.linalg.norm(first.target - first.position))
        camera.near, camera.far = _NEAR * reach, _FAR * reach

    @property
    def wish(self) -> Wish:
        """What the panels ask for now."""
        photographs = self.photographs
        how = photographs.comparison
        return Wish(
            kind=self.view.kind,
            edge=self.view.size,
            aperture=self.lens.aperture,
            crop=self.crop.box,
            comparison=how,
            share=0.0 if how == "off" else photographs.share,
            photograph=None if how == "off" else photographs.chosen,
        )

    @property
    def hands_over(self) -> bool:
        """Whether a browser may draw by itself: colours of pinholes, if nobody asked us to."""
        plain = self.view.kind == KINDS[0] and self.lens.aperture is None
        return plain and self.view.browser_draws

    def watch(
        self,
        joined: Callable[[Any, Pose], None],
        moved: Callable[[int, Pose], None],
        left: Callable[[int], None],
    ) -> None:
        """Say what is to be called, from viser's thread, as pages come, move and go."""

        # Coroutines run on the thread that takes messages, so that a pose is never half new.
        async def on_move(camera: Any) -> None:
            pose = pose_of(camera)
            if pose is not None:
                moved(camera.client.client_id, pose)

        async def on_join(client: Any) -> None:
            pose = pose_of(client.camera)
            if pose is not None:
                joined(client, pose)
                client.camera.on_update(on_move)

        async def on_leave(client: Any) -> None:
            self.path.leave(client)
            left(client.client_id)

        self._server.on_client_connect(on_join)
        self._server.on_client_disconnect(on_leave)

    def show(self, client: Any, picture: NDArray[np.float32], quality: int) -> None:
        """Send a (height, width, 3) picture in display light to one page."""
        codes = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
        with sending():
            client.scene.set_background_image(codes, format="jpeg", jpeg_quality=quality)
            client.flush()

    def hand_over(self, client: Any, splats: Any, background: NDArray[np.float32]) -> None:
        """Let a page draw splats by itself, before a (3,) background in display light."""
        with sending(), client.atomic():
            splats.visible = True
            codes = np.rint(np.tile(255 * background, (2, 2, 1))).astype(np.uint8)
            client.scene.set_background_image(codes, format="png")
        client.flush()

    def tell(self, facts: str) -> None:
        """What the panel says about the last picture, in plain lines."""
        with sending():
            self.view.tell(facts)

    def close(self) -> None:
        """Stop serving, and playing first, for which the end of this program would wait."""
        self.path.stop()
        self._end()

    def _end(self) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()


def sending() -> contextlib.AbstractContextManager[None]:
    """Let nothing end the owner of the splats that viser meets while it wakes its pages.

    It does so from whichever thread sends, while other pages come and go, and now and then fails
    by that; what was to be sent is queued by then, and goes with the next.
    """
    return contextlib.suppress(RuntimeError)


def _viser() -> Any:
    """viser, which is optional; everything of it is untyped here, installed or not."""
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        what = "splats are shown in a browser by"
        raise not_installed(what, "viser", "'viser>=1.1,<1.2'") from error


def _check_port(port: int) -> None:
    """Make sure that a port can be had.

    Raises:
        InputError: it cannot.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"--port is {port}, wanted 0 to 65535")
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, port))
        except OSError as error:
            raise _taken(port) from error


def _taken(port: int) -> InputError:
    return InputError(
        f"port {port} cannot be had, something may listen there: name another (--port)"
    )
