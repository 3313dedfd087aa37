"""One picture for a page: drawn by our kernels, cropped, with a photograph over it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.cameras.film_path import film
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.pictures.depth_picture import depth_and_alpha, depth_picture, depth_window
from rift_cl.commands.pictures.small_looks import LOOKS, small_looks
from rift_cl.commands.view.crop import Crop, cropped
from rift_cl.commands.view.photographs import Photograph, compared, seen_by, taken_from
from rift_cl.commands.view.wish import KINDS, Wish
from rift_cl.errors import RiftError
from rift_cl.geometry import Camera
from rift_cl.io.images.display_light import LightKind
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float32]

# Share of the line integrals of X-rays, of those that are not 0, that is darker than white.
_WHITE = 0.995
# What an orbit sees by which scales are chosen where nobody knows the scene's cameras.
_SIZE, _FOV = (64, 64), 45.0


class Painter:
    """Draws what is wished for, and keeps what the next picture may be made of.

    ``drawn`` counts how often splats were drawn; ``trouble`` says what the last picture lacks.
    Scales of grey and of depth go by what the scene's cameras see, and not by what a page does: the
    same pose gives the same picture, whoever looked from where before.

    Args:
        background: (3,) behind the splats, in their light.
        light: that the splats' colours are in.
        bounds: of the scene.
    """

    def __init__(self, background: Floats, light: LightKind, bounds: SceneBounds) -> None:
        self._background, self._light = background, light
        distance = bounds.distance
        self._reach = bounds.radius if distance is None else distance
        self._cameras = bounds.cameras or film(bounds, frames=LOOKS, size=_SIZE, fov=_FOV)
        self.drawn, self.trouble = 0, ""
        # The splats in a box, what was drawn last, and the photograph as it was seen last.
        self._kept: dict[str, tuple[Any, Any]] = {}

    def paint(
        self, splats: Splats, renderer: Renderer, camera: Camera, wish: Wish, version: int
    ) -> Floats:
        """A picture (height, width, 3) in display light.

        Args:
            splats: to draw, on the renderer's device.
            renderer: draws them.
            camera: of the page.
            wish: what the page asks for.
            version: changes whenever the splats do.
        """
        # X-rays go through no lens.
        aperture = None if renderer.settings.mode == "xray" else wish.aperture
        lensed = Camera(camera.size, camera.K, camera.view, camera.model, aperture)
        key = (lensed, wish.kind, wish.crop, version)
        drawn = self._known("drawn", key, lambda: self._drawn(splats, renderer, *key))
        photograph, self.trouble = wish.photograph, ""
        if photograph is None or not taken_from(photograph, camera, self._reach):
            return np.asarray(drawn)
        observed = self._known("seen", (photograph, camera), lambda: _observed(photograph, camera))
        if isinstance(observed, RiftError):
            self.trouble = str(observed)
            return np.asarray(drawn)
        image, known = observed
        return compared(drawn, image, known, wish.comparison, wish.share)

    def _drawn(
        self,
        splats: Splats,
        renderer: Renderer,
        camera: Camera,
        kind: str,
        crop: Crop | None,
        version: int,
    ) -> Floats:
        device, self.drawn = renderer.device, self.drawn + 1
        inside = self._known("crop", (crop, version), lambda: cropped(splats, crop, device))
        if renderer.settings.mode == "xray":
            integrals = device.get(renderer.forward(inside, camera).image)[..., :3]
            white = self._known("white", version, lambda: _white(renderer, splats, self._cameras))
            return np.asarray(np.clip(integrals / white, 0, 1))
        if kind == KINDS[0]:
            behind = device.array(self._background)
            frame = renderer.forward(inside, camera, background=behind)
            return in_display_light(device.get(frame.image)[..., :3], self._light)
        depth, alpha = depth_and_alpha(renderer, inside, camera)
        window = self._known(
            "window", version, lambda: depth_window(renderer, splats, self._cameras)
        )
        return depth_picture(depth, alpha, window)

    def _known(self, what: str, key: Any, make: Any) -> Any:
        """What was made for this key, or is made now."""
        if what not in self._kept or self._kept[what][0] != key:
            self._kept[what] = key, make()
        return self._kept[what][1]


def _white(renderer: Renderer, splats: Splats, cameras: Sequence[Camera]) -> float:
    """The line integral that is drawn white: nearly the largest that cameras see, or 1."""
    most = 0.0
    for camera in small_looks(cameras):
        # X-rays go through no lens.
        pinhole = Camera(camera.size, camera.K, camera.view, camera.model)
        integrals = renderer.device.get(renderer.forward(splats, pinhole).image)[..., :3]
        seen = integrals[integrals > 0]
        if seen.size:
            most = max(most, float(np.quantile(seen, _WHITE)))
    return most or 1.0


def _observed(photograph: Photograph, camera: Camera) -> Any:
    """A photograph from the page's camera, or why it cannot be had."""
    try:
        return seen_by(photograph, camera)
    except RiftError as error:
        return error
