"""The directions in which a camera sees splats, and what flows back through them.

A camera whose rays meet stands at o = -W^-1 t and sees a mean m in m - o, so that by dL/do = -dL/dm
its t gains W^-T dL/dm, and W that times o^T. The rays of an orthographic camera all go along the
third row of W, which no mean and no shift changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera

Floats = NDArray[np.float64]


def sights(means: Floats, camera: Camera) -> Floats:
    """(N, 3) the ways to means, of any length."""
    away: Floats = means - camera.center
    if camera.model == "ortho":
        away = np.tile(camera.view[2, :3], (len(means), 1))
    return away


def sights_grad(by_sights: Floats, camera: Camera) -> tuple[Floats, Floats]:
    """Gradients by means (N, 3) and by the upper rows of the view matrix (3, 4)."""
    if camera.model == "ortho":
        view = np.zeros((3, 4))
        view[2, :3] = by_sights.sum(0)
        return np.zeros_like(by_sights), view
    shift = np.linalg.inv(camera.view[:3, :3]).T @ by_sights.sum(0)
    return by_sights, np.column_stack([np.outer(shift, camera.center), shift])
