"""Splats: project, sort into tiles, rasterize, and the gradients of all of it.

``Renderer`` does all of it; its stages, ``shade``, ``project``, ``rasterize`` and their gradients,
are public for who puts them together in another way.

Public names are looked up when they are first used, so that settings load without the renderer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rift_cl.lazy_names import lazy_names

if TYPE_CHECKING:
    from rift_cl.splat.features import shade, shade_grad
    from rift_cl.splat.projection import SplatGradients, project, project_grad
    from rift_cl.splat.raster import ScreenModes, ScreenSplats, raster_grad, rasterize, sum_slots
    from rift_cl.splat.renderer import Frame, FrameGradients, Renderer
    from rift_cl.splat.settings import SplatSettings
    from rift_cl.splat.splats import Splats
    from rift_cl.splat.voxels import voxelise

__all__ = [
    "Frame",
    "FrameGradients",
    "Renderer",
    "ScreenModes",
    "ScreenSplats",
    "SplatGradients",
    "SplatSettings",
    "Splats",
    "project",
    "project_grad",
    "raster_grad",
    "rasterize",
    "shade",
    "shade_grad",
    "sum_slots",
    "voxelise",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "features": ("shade", "shade_grad"),
        "projection": ("SplatGradients", "project", "project_grad"),
        "raster": ("ScreenModes", "ScreenSplats", "raster_grad", "rasterize", "sum_slots"),
        "renderer": ("Frame", "FrameGradients", "Renderer"),
        "settings": ("SplatSettings",),
        "splats": ("Splats",),
        "voxels": ("voxelise",),
    },
)
