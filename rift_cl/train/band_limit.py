"""No splat finer than what the cameras resolve: the per-splat band limit of Mip-Splatting.

What is finer than half a pixel of every photograph was never sampled; a splat that holds it shows
it as soon as a camera comes nearer (Yu et al. 2024, section 4.1). The limit is a Gaussian blur in
space, set anew as splats move.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera
from rift_cl.train.start import focus_of


def camera_table(cameras: Sequence[Camera]) -> NDArray[np.float32]:
    """What ``kernels/splat_band.cl`` reads of cameras, (V, 17).

    An orthographic camera resolves the same at every depth: its third row gives every point the
    depth one.
    """
    return np.array([_row(camera) for camera in cameras], np.float32)


def _row(camera: Camera) -> list[float]:
    view = camera.view[:3].copy()
    if camera.model == "ortho":
        view[2] = (0, 0, 0, 1)
    fx, fy, cx, cy = camera.intrinsics
    return [*view.ravel(), max(fx, fy), cx, cy, camera.width, camera.height]


def unseen_length(cameras: Sequence[Camera]) -> float:
    """The limit of a splat that no camera sees: that of the scene's middle in the median camera."""
    middle = focus_of(cameras)
    depths = [abs(camera.view[2, :3] @ middle + camera.view[2, 3]) for camera in cameras]
    focal = [max(camera.intrinsics[:2]) for camera in cameras]
    return float(np.sqrt(0.2) * np.median(np.divide(depths, focal)))
