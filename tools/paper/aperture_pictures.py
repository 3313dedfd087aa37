"""Pictures through an aperture: where they come from, and what they are compared with.

With ``--full`` they are those of the capture ``aperture`` beside the ring: path-traced through a
thin lens. Without it they are made of splats fitted to the sharp pictures that come with the
package, drawn by many pinholes spread over the aperture and averaged in linear light: what a lens
does by definition, and nothing of what the renderer's blur assumes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.fits import fitted
from paper.plan import EPS2D, Plan
from paper.view_choice import write_capture
from rift_cl import Device
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera
from rift_cl.io import (
    SplatScene,
    make_folder,
    open_capture,
    read_view,
    to_display,
    to_linear,
    write_json,
    write_png,
)
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.splat import Renderer, SplatSettings

# Every so many-th azimuth is scored and never trained on.
EVERY = 4
FOCUS = 4.6
# Small pictures of coarse splats want wider apertures for the same blur in pixels.
_FULL, _QUICK = (0.05, 0.12, 0.25), (0.1, 0.3, 0.6)
_AZIMUTHS, _PINHOLES = 12, 48
_HOW = (
    "make it with 'python tools/render_ornament.py --views 24 --aperture-radius R "
    "--focus-distance 4.6' for radii R of 0.05, 0.12 and 0.25"
)

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Drawn:
    """Splats that were fitted to sharp pictures, and what draws them.

    Args:
        renderer: with the fit's own eps2d.
        splats: on its device.
        behind: (3,) device array, the background in display light.
    """

    renderer: Renderer
    splats: Any
    behind: Any

    def picture(self, camera: Camera) -> Image:
        """(height, width, 3) in display light."""
        frame = self.renderer.forward(self.splats, camera, background=self.behind)
        return np.clip(self.renderer.device.get(frame.image), 0, 1)

    def depth(self, camera: Camera) -> tuple[Image, Image]:
        """(height, width) expected depth, and alpha."""
        device = self.renderer.device
        frame = self.renderer.forward(self.splats, camera, background=self.behind, depth="expected")
        return device.get(frame.image)[..., -1], 1 - device.get(frame.transmittance)


def sharp_splats(plan: Plan, device: Device) -> Drawn:
    """Splats fitted to the sharp pictures of the ring, to as many as any figure takes."""
    fit = fitted(plan, plan.counts[-1])
    splats = SplatScene.load(fit.settings.out / "scene.ply").upload(device)
    behind = device.array(np.array(fit.metrics["background"], np.float32))
    return Drawn(Renderer(SplatSettings(eps2d=EPS2D), device=device), splats, behind)


def radii(plan: Plan) -> tuple[float, ...]:
    """The apertures, the smallest first."""
    return _FULL if plan.full else _QUICK


def pinhole(camera: Camera) -> Camera:
    """The same camera without its aperture."""
    return Camera(camera.size, camera.K, camera.view)


def many_pinholes(drawn: Drawn, camera: Camera) -> Image:
    """The mean of pinholes spread over the aperture, each looking so that the focus stays put."""
    lens, total = camera.aperture, np.zeros((*camera.size, 3), np.float32)
    if lens is None:
        raise InputError("many_pinholes: the camera has no aperture to spread them over")
    fx, fy, _, _ = camera.intrinsics
    for x, y in lens.radius * pupil_points(_PINHOLES):
        view, K = camera.view.copy(), camera.K.copy()
        view[:2, 3] -= x, y
        K[:2, 2] += fx * x / lens.focus, fy * y / lens.focus
        picture = drawn.picture(Camera(camera.size, K, view))
        to_linear(picture)
        total += picture / _PINHOLES
    to_display(total)
    return total


def pupil_points(count: int) -> NDArray[np.float64]:
    """Points evenly over the unit disc, (count, 2): Vogel's spiral."""
    places = np.arange(count) + 0.5
    radius, angle = np.sqrt(places / count), places * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def lens_capture(plan: Plan, drawn: Drawn) -> Path:
    """The folder of the pictures through three apertures, all three from each azimuth in turn.

    Raises:
        InputError: they do not lie beside the ring.
    """
    if plan.full:
        folder = plan.captures.ring.parent / "aperture"
        if not (folder / "transforms.json").is_file():
            raise InputError(f"{folder}: holds no transforms.json; {_HOW}")
        return folder
    folder = make_folder(plan.out / "fits" / "quick" / "aperture")
    ring = open_capture(plan.captures.ring).views
    cameras, names = [], []
    for place in np.arange(_AZIMUTHS) * len(ring) // _AZIMUTHS:
        for radius in radii(plan):
            names.append(f"{len(names):04}.png")
            given = ring[int(place)].camera
            lens = Aperture(radius, FOCUS)
            cameras.append(Camera(given.size, given.K, given.view, aperture=lens))
            write_png(folder / names[-1], many_pinholes(drawn, cameras[-1]))
    write_json(folder / "transforms.json", transforms_of(cameras, names))
    return folder


def split_azimuths(capture: Path, folder: Path) -> tuple[Path, Path]:
    """Two captures of it: what is trained on, and every 4th azimuth, which is scored."""
    count = len(open_capture(capture).views)
    places = np.arange(count)
    scored = (places // len(_FULL)) % EVERY == 0
    return (
        write_capture(capture, places[~scored].tolist(), folder / "seen_through_lens"),
        write_capture(capture, places[scored].tolist(), folder / "unseen_through_lens"),
    )


def linear_pictures(capture: Path, places: Sequence[int]) -> list[Image]:
    """Some pictures of a capture in linear light, (height, width, 3)."""
    views = open_capture(capture).views
    return [read_view(views[place], light="linear")[..., :3] for place in places]
