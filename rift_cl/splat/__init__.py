"""Splats: project, sort into tiles, rasterize, and the gradients of all of it."""

from rift_cl.splat.batch import draw_views, views_grad
from rift_cl.splat.renderer import Frame, FrameGradients, Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

__all__ = [
    "Frame",
    "FrameGradients",
    "Renderer",
    "SplatSettings",
    "Splats",
    "draw_views",
    "views_grad",
]
