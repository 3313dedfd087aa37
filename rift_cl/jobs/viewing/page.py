"""The page that a viewer shows: viser's server, its panel, and where its cameras are.

All that is spoken with viser is in this file. It prints where it listens and offers to share the
page with the world through a server of its own; neither is wanted here.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import socket
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.jobs.viewing.guard import Guard
from rift_cl.jobs.viewing.pose import Pose

_HOST = "127.0.0.1"
KINDS = ("colour", "depth")
_SMALLEST, _LARGEST = 64, 4096


class ViewerPage:
    """viser's server on this computer alone, with our panel.

    Args:
        port: to listen on; 0 for any that is free.
        size: longer edge in pixels that the panel begins with.
        title: above the panel.
        asked: called from viser's threads when the panel is changed.

    Raises:
        InputError: viser is not installed, or the port cannot be had.
    """

    def __init__(self, *, port: int, size: int, title: str, asked: Callable[[], None]) -> None:
        if not _SMALLEST <= size <= _LARGEST:
            raise InputError(f"--size is {size}, wanted {_SMALLEST} to {_LARGEST} pixels")
        viser = _viser()
        _check_port(port)
        guard = Guard()
        with contextlib.redirect_stdout(io.StringIO()), guard.before_viser():
            self._server = viser.ViserServer(host=_HOST, port=port, label=title, verbose=False)
        # viser takes the next port that is free, which is not what was asked for.
        if port and self._server.get_port() != port:
            self.close()
            raise _taken(port)
        if not guard.asked:
            self.close()
            raise InputError("this viser cannot be guarded: pip install 'viser>=1.1,<1.2'")
        self.url = f"http://{_HOST}:{self._server.get_port()}/{guard.token}"
        # What a page sends may make viser's callbacks fail: its own loss, and nobody's concern.
        self._server.get_event_loop().set_exception_handler(lambda *_: None)
        # A page may ask for a tunnel through a server on the internet, whatever it shows.
        self._server.request_share_url = lambda *_, **__: None
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="small")
        self._kind = gui.add_dropdown("show", KINDS, initial_value=KINDS[0])
        self._size = gui.add_slider(
            "size", min=_SMALLEST, max=max(2048, size), step=1, initial_value=size
        )
        self._facts = gui.add_markdown("")
        for handle in (self._kind, self._size):
            handle.on_update(lambda _: asked())

    @property
    def kind(self) -> str:
        """Which of ``KINDS`` is to be shown."""
        kind = self._kind.value
        return kind if kind in KINDS else KINDS[0]

    @property
    def size(self) -> int:
        """Longer edge in pixels that is asked for."""
        return int(np.clip(self._size.value, _SMALLEST, _LARGEST))

    def begin_at(self, position: ArrayLike, target: ArrayLike, up: ArrayLike, fov: float) -> None:
        """Where the camera of a page that is opened stands; the field of view in degrees."""
        self._server.scene.set_up_direction(tuple(np.asarray(up, float).tolist()))
        camera = self._server.initial_camera
        camera.position = tuple(np.asarray(position, float).tolist())
        camera.look_at = tuple(np.asarray(target, float).tolist())
        camera.fov = float(np.radians(fov))

    def watch(
        self,
        joined: Callable[[Any, Pose], None],
        moved: Callable[[int, Pose], None],
        left: Callable[[int], None],
    ) -> None:
        """Say what is to be called, from viser's thread, as pages come, move and go."""

        # Coroutines run on the thread that takes messages, so that a pose is never half new.
        async def on_move(camera: Any) -> None:
            pose = _pose_of(camera)
            if pose is not None:
                moved(camera.client.client_id, pose)

        async def on_join(client: Any) -> None:
            pose = _pose_of(client.camera)
            if pose is not None:
                joined(client, pose)
                client.camera.on_update(on_move)

        async def on_leave(client: Any) -> None:
            left(client.client_id)

        self._server.on_client_connect(on_join)
        self._server.on_client_disconnect(on_leave)

    def show(self, client: Any, picture: NDArray[np.float32], quality: int) -> None:
        """Send a (height, width, 3) picture in display light to one page."""
        codes = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
        client.scene.set_background_image(codes, format="jpeg", jpeg_quality=quality)
        client.flush()

    def tell(self, splats: int, size: tuple[int, int], seconds: float) -> None:
        """What the panel says about the last picture."""
        self._facts.content = (
            f"{splats} splats, {size[1]} x {size[0]} pixels, "
            f"{1 / max(seconds, 1e-6):.3g} frames per second"
        )

    def close(self) -> None:
        """Stop serving."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()


def _viser() -> Any:
    """viser, which is optional; everything of it is untyped here, installed or not."""
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise InputError(
            f"showing splats in a browser needs viser ({error}): pip install 'rift-cl[view]'"
        ) from error


def _pose_of(camera: Any) -> Pose | None:
    """Where a page says that its camera is; None where it says nonsense."""
    size = camera.image_height, camera.image_width
    try:
        return Pose.said(camera.wxyz, camera.position, camera.fov, *size)
    except InputError:
        return None


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
