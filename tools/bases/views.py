"""Cameras and renderer of additive splats: a flat picture, or the views of a parallel scan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl import Device
from rift_cl.geometry import Camera
from rift_cl.splat import Renderer, SplatSettings


def additive_renderer(device: Device, *, tile: int, eps2d: float) -> Renderer:
    """A renderer that adds splats, in front of the camera or behind it."""
    settings = SplatSettings(mode="xray", near=-1e6, eps2d=eps2d, tile=tile)
    return Renderer(settings, device=device)


def upright_camera(height: int, width: int) -> Camera:
    """A camera that sees the plane z = 0 pixel by pixel, x to the right and y downwards."""
    K = [[1, 0, width / 2], [0, 1, height / 2], [0, 0, 1]]
    return Camera((height, width), K, np.eye(4), "ortho")


def turned_cameras(height: int, width: int, angles: NDArray[np.float64]) -> list[Camera]:
    """Cameras of a parallel scan: x along (cos, sin, 0) of each angle, y along z."""
    K = [[1, 0, width / 2], [0, 1, height / 2], [0, 0, 1]]
    views = []
    for angle in angles:
        c, s = np.cos(angle), np.sin(angle)
        view = np.eye(4)
        view[:3, :3] = [[c, s, 0], [0, 0, 1], [s, -c, 0]]
        views.append(Camera((height, width), K, view, "ortho"))
    return views
