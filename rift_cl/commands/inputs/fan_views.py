"""A fan beam as cameras: the source is where a camera stands, a row of the detector its picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.geometry import Camera, FanBeam


def fan_cameras(fan: FanBeam, angles: ArrayLike, bins: int) -> tuple[Camera, ...]:
    """Pinhole cameras with pictures of one row that see what the rays of a fan beam see.

    Args:
        fan: source and detector.
        angles: (V,) radians.
        bins: of the detector.
    """
    focal = fan.source_to_detector / fan.pitch
    K = np.array([[focal, 0, fan.center + 0.5], [0, focal, 0.5], [0, 0, 1]])
    cameras = []
    for angle in np.asarray(angles, np.float64):
        sine, cosine = np.sin(angle), np.cos(angle)
        view = np.eye(4)
        # Bins grow to the right, rays go forward; z points against what a picture calls down.
        view[:3, :3] = [[cosine, sine, 0], [0, 0, -1], [-sine, cosine, 0]]
        view[2, 3] = fan.source_to_axis
        cameras.append(Camera((1, bins), K, view))
    return tuple(cameras)
