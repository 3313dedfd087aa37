"""In which directions a camera sees splats: what shading is told of it.

The rays of pinholes and fisheyes meet where the camera stands. Those of an orthographic camera are
parallel, so that it sees every splat along its axis, however far off it stands.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera

Floats = NDArray[np.float64]


def sight_of(camera: Camera) -> Floats:
    """(3,) where all rays of a camera meet, or the way of each where they are parallel."""
    return camera.axis if camera.model == "ortho" else camera.center


def sight_macros(camera: Camera) -> dict[str, Any]:
    """What kernels are compiled with, besides being given ``sight_of``."""
    return {"PARALLEL": True} if camera.model == "ortho" else {}


def ways_to(camera: Camera, means: Floats) -> Floats:
    """(N, 3) the ways of the rays that go to splats, of any length."""
    if camera.model == "ortho":
        return np.broadcast_to(camera.axis, means.shape)
    return means - camera.center


def sight_gradient(camera: Camera, by_ways: Floats) -> tuple[Floats, Floats]:
    """The gradient of ``ways_to``: by the means, (N, 3), and by the view's upper rows, (3, 4)."""
    if camera.model == "ortho":
        view = np.zeros((3, 4))
        view[2, :3] = by_ways.sum(axis=0)
        return np.zeros_like(by_ways), view
    total = by_ways.sum(axis=0) @ np.linalg.inv(camera.view[:3, :3])
    return by_ways, np.column_stack([np.outer(total, camera.center), total])
