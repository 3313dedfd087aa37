"""One picture for a page: drawn by our kernels, cropped, with a photograph over it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.pictures.depth_picture import depth_and_alpha, depth_picture, window_of
from rift_cl.commands.view.crop import Crop, cropped
from rift_cl.commands.view.photographs import Photograph, compared, seen_by, taken_from
from rift_cl.commands.view.wish import KINDS, Wish
from rift_cl.errors import RiftError
from rift_cl.geometry import Camera
from rift_cl.io.images.display_light import LightKind
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float32]

# Share of the line integrals of X-rays that is darker than white.
_WHITE = 0.995


class Painter:
    """Draws what is wished for, and keeps what the next picture may be made of.

    ``drawn`` counts how often splats were drawn; ``trouble`` says what the last picture lacks.

    Args:
        background: (3,) behind the splats, in their light.
        light: that the splats' colours are in.
        bounds: of the scene.
    """

    def __init__(self, background: Floats, light: LightKind, bounds: SceneBounds) -> None:
        self._background, self._light = background, light
        distance = bounds.distance
        self._reach = bounds.radius if distance is None else distance
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
        lensed = Camera(camera.size, camera.K, camera.view, camera.model, wish.aperture)
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
            most = self._known("most", version, lambda: _most(integrals))
            return np.asarray(np.clip(integrals / most, 0, 1))
        if kind == KINDS[0]:
            behind = device.array(self._background)
            frame = renderer.forward(inside, camera, background=behind)
            return in_display_light(device.get(frame.image)[..., :3], self._light)
        depth, alpha = depth_and_alpha(renderer, inside, camera)
        return depth_picture(depth, alpha, window_of(depth, alpha))

    def _known(self, what: str, key: Any, make: Any) -> Any:
        """What was made for this key, or is made now."""
        if what not in self._kept or self._kept[what][0] != key:
            self._kept[what] = key, make()
        return self._kept[what][1]


def _most(integrals: Floats) -> float:
    """The line integral that is drawn white: nearly the largest, or 1 where there are none."""
    return float(np.quantile(integrals, _WHITE)) or 1.0


def _observed(photograph: Photograph, camera: Camera) -> Any:
    """A photograph from the page's camera, or why it cannot be had."""
    try:
        return seen_by(photograph, camera)
    except RiftError as error:
        return error
