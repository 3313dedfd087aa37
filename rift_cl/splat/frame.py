"""A drawn image with what its gradient needs, and the gradients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rift_cl.geometry import Camera
from rift_cl.splat.features import Channels
from rift_cl.splat.projected import Projected, SplatGradients
from rift_cl.splat.raster import Raster, ScreenSplats
from rift_cl.splat.splats import Splats
from rift_cl.splat.tile_lists import TileLists


@dataclass(frozen=True, eq=False)
class Frame:
    """A drawn image with what its gradient needs.

    Args:
        splats: what was drawn.
        camera: what drew it.
        background: (D,) with 0 for depth, or None.
        depth: ``accumulated``, ``expected``, or None.
        channels: what the image's channels are.
        projected: the splats on the screen.
        screen: the same as the raster takes them.
        lists: the tile lists; None where they did not fit and the image was drawn in bands.
        raster: the image, and what the raster left for its gradient.
    """

    splats: Splats
    camera: Camera
    background: Any
    depth: str | None
    channels: Channels
    projected: Projected
    screen: ScreenSplats
    lists: TileLists | None
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
        colors: (N, D) by the splats' own colours; None where they have none.
        sh: (N, K, 3) by the spherical harmonics; None where there are none.
        camera: (16,): by the upper three rows of the view matrix, then fx, fy, cx, cy; None if
            not asked for.
        background: by the background as it was given; None where there was none.
    """

    splats: SplatGradients
    colors: Any
    sh: Any
    camera: Any
    background: Any
