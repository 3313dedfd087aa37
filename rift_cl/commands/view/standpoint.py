"""Positions that a page's camera is moved to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera

Floats = NDArray[np.float64]

# Cosine below which the scene's up is along the camera's axis, or below it, and says nothing.
_STEEP = 0.05


@dataclass(frozen=True, eq=False)
class Standpoint:
    """A camera by what viser's controls turn it about.

    Args:
        position: (3,) where it stands, in world coordinates.
        target: (3,) what it looks at and turns about.
        up: (3,) about which it turns from side to side.
        fov: vertical field of view in radians.
    """

    position: Floats
    target: Floats
    up: Floats
    fov: float


def standpoint_of(camera: Camera, focus: Floats, up: Floats, aspect: float) -> Standpoint:
    """The standpoint from which a window shows all that a camera sees.

    Args:
        camera: a pinhole.
        focus: (3,) what the scene's cameras look at: its depth is what the page turns about.
        up: (3,) the scene's up, which is kept but for what the camera is rolled.
        aspect: width of the window divided by its height.
    """
    right, down, forward = camera.view[:3, :3]
    depth = float((focus - camera.center) @ forward)
    away = depth if depth > 0 else float(np.linalg.norm(focus - camera.center)) or 1.0
    fx, fy, cx, cy = camera.intrinsics
    tall = max(cy, camera.height - cy) / fy
    wide = max(cx, camera.width - cx) / fx
    level = up - (up @ right) * right
    upright = level if -(level @ down) > _STEEP else -down
    return Standpoint(
        position=camera.center,
        target=camera.center + away * forward,
        up=upright / np.linalg.norm(upright),
        fov=2 * math.atan(max(tall, wide / aspect)),
    )
