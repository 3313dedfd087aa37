"""Splats: project, sort into tiles, rasterize, and the gradients of all of it.

Public names are looked up when they are first used, so that settings load without the renderer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rift_cl.lazy_names import lazy_names

if TYPE_CHECKING:
    from rift_cl.splat.renderer import Frame, FrameGradients, Renderer
    from rift_cl.splat.settings import SplatSettings
    from rift_cl.splat.splats import Splats

__all__ = [
    "Frame",
    "FrameGradients",
    "Renderer",
    "SplatSettings",
    "Splats",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "renderer": ("Frame", "FrameGradients", "Renderer"),
        "settings": ("SplatSettings",),
        "splats": ("Splats",),
    },
)
