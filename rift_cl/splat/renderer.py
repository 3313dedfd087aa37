"""The whole way from splats to an image and back, resident on the device.

``forward`` keeps what its gradient needs in a ``Frame``; ``backward`` turns dL/d image into
gradients of every parameter. Nothing is summed by atomics, so the same call gives the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.geometry import Camera
from rift_cl.splat.projected import CULL_REASONS, Projected, SplatGradients
from rift_cl.splat.projection import (
    project,
    project_grad,
    shade,
    shade_grad,
    sum_columns,
)
from rift_cl.splat.raster import Raster, ScreenSplats, raster_grad, rasterize
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats
from rift_cl.splat.tile_lists import TileLists, tile_lists


@dataclass(frozen=True, eq=False)
class Frame:
    """A drawn image with what its gradient needs.

    Args:
        splats: what was drawn.
        camera: what drew it.
        background: (D,) or None.
        projected: the splats on the screen.
        screen: the same as the raster takes them.
        lists: the tile lists.
        raster: the image, and what the raster left for its gradient.
    """

    splats: Splats
    camera: Camera
    background: Any
    projected: Projected
    screen: ScreenSplats
    lists: TileLists
    raster: Raster

    @property
    def image(self) -> Any:
        """(height, width, D) device array, the background included."""
        return self.raster.image

    @property
    def transmittance(self) -> Any:
        """(height, width) device array, what of the background is seen; alpha is one minus it."""
        return self.raster.transmittance


@dataclass(frozen=True, eq=False)
class FrameGradients:
    """Gradients of a loss by everything that a frame was made of; device arrays.

    Args:
        splats: by the splats' parameters and their positions on the screen.
        sh: (N, K, 3) by the spherical harmonics; None where the splats have colours.
        camera: (16,): by the upper three rows of the view matrix, then fx, fy, cx, cy; None if
            not asked for.
        background: (D,); None where there was none.
    """

    splats: SplatGradients
    sh: Any
    camera: Any
    background: Any


class Renderer:
    """Draws splats and differentiates the drawing.

    Args:
        settings: every switch of the rasterizer.
        device: where to work; the default device if not given.
    """

    def __init__(
        self, settings: SplatSettings | None = None, *, device: Device | None = None
    ) -> None:
        self.settings = settings or SplatSettings()
        self.device = device or default_device()

    def forward(self, splats: Splats, camera: Camera, *, background: Any = None) -> Frame:
        """Draw splats.

        Args:
            splats: parameters on this renderer's device, with ``colors`` or ``sh``.
            camera: the view.
            background: (D,) device array; black if not given.

        Raises:
            InputError: the splats have neither colours nor spherical harmonics.
            ResourceLimitError: the tile lists do not fit the memory budget.
        """
        device, settings = self.device, self.settings
        projected = project(device, splats, camera, settings)
        features = splats.colors
        if features is None:
            features = shade(device, splats, camera, projected)
        height, width = camera.size
        lists = tile_lists(
            device,
            *(projected.boxes, projected.screen),
            tiles_x=-(-width // settings.tile),
            tiles_y=-(-height // settings.tile),
            sort=settings.mode == "light",
        )
        screen = ScreenSplats(projected.screen, projected.radii, features)
        drawn = rasterize(
            device, screen, lists, camera.size, settings=settings, background=background
        )
        return Frame(splats, camera, background, projected, screen, lists, drawn)

    def backward(
        self,
        frame: Frame,
        grad_image: Any,
        grad_transmittance: Any = None,
        *,
        with_camera: bool = False,
    ) -> FrameGradients:
        """The gradient of a loss by everything that made a frame.

        Args:
            frame: what ``forward`` returned.
            grad_image: dL/d image, (height, width, D) device array.
            grad_transmittance: dL/d transmittance, (height, width); zero if not given.
            with_camera: differentiate by pose and intrinsics as well.
        """
        device, settings = self.device, self.settings
        records = raster_grad(
            device,
            *(frame.screen, frame.lists, frame.raster, grad_image, grad_transmittance),
            settings=settings,
            background=frame.background,
        )
        gradients = project_grad(
            device,
            *(frame.splats, frame.camera, settings),
            projected=frame.projected,
            slots=frame.lists.slots,
            records=records,
            with_camera=with_camera,
        )
        sh = None
        if frame.splats.colors is None:
            sh = shade_grad(
                device,
                *(frame.splats, frame.camera),
                colors=frame.screen.features,
                gradients=gradients,
            )
        camera = sum_columns(device, gradients.camera) if with_camera else None
        return FrameGradients(gradients, sh, camera, self._background_grad(frame, grad_image))

    def _background_grad(self, frame: Frame, grad_image: Any) -> Any:
        if frame.background is None or self.settings.mode == "xray":
            return None
        height, width, channels = frame.image.shape
        seen = self.device.empty((height * width, channels))
        self.device.launch(
            "background_grad",
            (height * width,),
            *(grad_image, frame.transmittance, seen, height * width, channels),
        )
        return sum_columns(self.device, seen)

    def culled(self, frame: Frame) -> dict[str, int]:
        """How many splats were left out of a frame, by reason."""
        codes = np.bincount(self.device.get(frame.projected.culled), minlength=len(CULL_REASONS))
        return {
            reason: int(count) for reason, count in zip(CULL_REASONS, codes, strict=True) if count
        }
