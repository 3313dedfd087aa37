"""One self-contained page that draws splats in any browser: viser's client with the scene in it.

viser (https://viser.studio, MIT) brings the client and writes the scene into it; its server runs
for a moment on this computer alone, guarded as that of ``rift view``. The page asks nothing of the
network, and a content security policy in its head makes sure of it.

viser draws Gaussians of one colour each: see ``rift_cl.commands.view.browser_splats``. The page's
unit is a tenth of the first camera's distance.
"""

from __future__ import annotations

import contextlib
import importlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.view.browser_splats import AWAY, browser_splats
from rift_cl.commands.view.guard import Guard
from rift_cl.errors import InputError, not_installed
from rift_cl.geometry import Camera
from rift_cl.io.scenes.splat_scene import SplatScene

Floats = NDArray[np.float64]

# How near and far the page draws, in its units.
_NEAR, _FAR = 0.01, 1e5
# The client is packed into its page: it unpacks itself, compiles and starts workers, and no more.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:; worker-src blob: "
    "data:; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; connect-src data: blob:"
)
# The client sorts splats in a worker made from a blob. Chromium starts no such worker, a module,
# for a page that was opened from a disk, or is in a frame that is kept apart from its notebook;
# told that there are no blobs, the client takes a data URL.
_WORKERS = (
    '<script>if(location.protocol==="file:"||self.origin==="null"){const make=URL.createObjectURL;'
    "URL.createObjectURL=(blob)=>{if(/javascript/.test(blob.type))"
    'throw new Error("no workers from blobs here");return make.call(URL,blob);};}</script>'
)


@dataclass(frozen=True, eq=False)
class FirstView:
    """Where a page begins.

    Args:
        camera: whose picture is seen first.
        target: (3,) what it turns about.
        up: (3,) unit vector.
    """

    camera: Camera
    target: Floats
    up: Floats


def web_page(
    scene: SplatScene,
    first: FirstView,
    cameras: Sequence[Camera],
    *,
    title: str,
    background: NDArray[np.float32],
) -> str:
    """The page.

    Args:
        scene: of plain splats in display light.
        first: where it begins.
        cameras: that colours are averaged over; the first one where there are none.
        title: of the page.
        background: (3,) behind the splats, in display light.

    Raises:
        InputError: viser is not installed, or its page cannot be guarded.
    """
    unit = AWAY / max(float(np.linalg.norm(first.camera.center - first.target)), 1e-12)
    gaussians = browser_splats(scene, cameras or [first.camera], unit)
    server = _server()
    try:
        server.scene.set_up_direction(_numbers(first.up))
        _begin(server.initial_camera, first, unit)
        server.scene.set_background_image(
            np.rint(np.tile(255 * background, (2, 2, 1))).astype(np.uint8), format="png"
        )
        server.scene.add_gaussian_splats("/splats", **gaussians)
        page: str = server.scene.as_html(dark_mode=True)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
    policy = f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}" />'
    head, found, rest = page.partition("<head>")
    if not found:
        raise InputError(
            "viser writes a page that cannot be kept from the network, for it has no <head>: "
            "pip install 'viser>=1.1,<1.2'"
        )
    page = f"{head}{found}{policy}{_WORKERS}{rest}"
    return page.replace("<title>Viser</title>", f"<title>{escape(title)}</title>", 1)


def _begin(handle: Any, first: FirstView, unit: float) -> None:
    """Tell viser of the first view; its roll is given up, so that turning keeps the horizon."""
    camera = first.camera
    forward = camera.view[2, :3]
    depth = max(float(forward @ (first.target - camera.center)), 1e-6 / unit)
    handle.position = _numbers(camera.center * unit)
    handle.look_at = _numbers((camera.center + depth * forward) * unit)
    handle.fov = 2 * float(np.arctan(camera.size[0] / 2 / camera.K[1, 1]))
    handle.near, handle.far = _NEAR, _FAR


def _server() -> Any:
    try:
        viser = importlib.import_module("viser")
    except ImportError as error:
        raise not_installed("a page is made by", "viser", "'viser>=1.1,<1.2'") from error
    guard = Guard()
    with contextlib.redirect_stdout(io.StringIO()), guard.before_viser():
        return viser.ViserServer(host="127.0.0.1", port=0, verbose=False)


def _numbers(vector: Floats) -> tuple[float, ...]:
    return tuple(np.asarray(vector, float).tolist())
