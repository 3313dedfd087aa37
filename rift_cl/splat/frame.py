"""A drawn image with what its gradient needs, and the gradients."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.array import DeviceArray
from rift_cl.geometry import Camera
from rift_cl.splat.drawing import Drawing
from rift_cl.splat.features import Channels
from rift_cl.splat.projected import Projected, SplatGradients
from rift_cl.splat.raster import Raster
from rift_cl.splat.splats import Splats
from rift_cl.splat.tile_lists import TileLists


@dataclass(frozen=True, eq=False)
class Frame:
    """A drawn image with what its gradient needs.

    Args:
        splats: what was drawn.
        camera: what drew it.
        depth: ``accumulated``, ``expected``, or None.
        channels: what the image's channels are.
        drawing: the splats on the screen, the image, and what the raster left for its gradient.
    """

    splats: Splats
    camera: Camera
    depth: str | None
    channels: Channels
    drawing: Drawing

    @property
    def image(self) -> DeviceArray:
        """(height, width, D) device array, the background included."""
        return self.drawing.raster.image

    @property
    def transmittance(self) -> DeviceArray:
        """(height, width) device array, what of the background is seen; alpha is one minus it."""
        return self.drawing.raster.transmittance

    @property
    def projected(self) -> Projected:
        """The splats on the screen."""
        return self.drawing.projected

    @property
    def lists(self) -> TileLists | None:
        """The tile lists; None where the image was drawn in bands."""
        return self.drawing.lists

    @property
    def raster(self) -> Raster:
        """The image, and what the raster left for its gradient."""
        return self.drawing.raster


@dataclass(frozen=True, eq=False)
class FrameGradients:
    """Gradients of a loss by everything that a frame was made of; device arrays.

    Args:
        splats: by the splats' parameters and their positions on the screen.
        colors: (N, D) by the splats' own colours; None where they have none.
        sh: (N, K, 3) by the spherical harmonics; None where there are none.
        camera: (16,): by the upper three rows of the view matrix, then fx, fy, cx, cy; None if
            not asked for.
        aperture: (2,): by the aperture's radius and focus; None if the camera's is not asked
            for, or has none.
        background: by the background as it was given; None where there was none.
        shape_modes: (N, K - 1) by the modes of the densities; None where there are none.
        color_modes: (N, K - 1, C) by those of the colours; None where there are none.
        lobes: (N, G) by the geometry of the lobes; None where there are none.
    """

    splats: SplatGradients
    colors: DeviceArray | None
    sh: DeviceArray | None
    camera: DeviceArray | None
    aperture: DeviceArray | None
    background: DeviceArray | None
    shape_modes: DeviceArray | None = None
    color_modes: DeviceArray | None = None
    lobes: DeviceArray | None = None
