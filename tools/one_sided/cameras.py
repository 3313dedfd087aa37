"""Where a person with a camera in the hand stands before a wall: to and fro, never behind it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ornament.cameras import around

# The cameras' middle azimuth: they stand at -y.
_FRONT = -90.0
# Rows that are walked, by elevation in degrees, and how far to either side.
_ROWS, _SIDE = (4.0, 17.0, -6.0), 42.0


def walk(views: int, seed: int, distance: float) -> list[NDArray[np.float64]]:
    """Poses (4, 4), camera to world, OpenGL axes: three rows, each in the other sense.

    A hand is not steady: distances differ by 8 %, the middle of the picture by .1 units, the
    horizon by a degree.

    Args:
        views: how many.
        seed: of the hand.
        distance: from the subject's middle.
    """
    random = np.random.default_rng((seed, 0x3A7D))
    poses = []
    for way in np.linspace(0, len(_ROWS), views, endpoint=False) + len(_ROWS) / views / 2:
        row = int(way)
        along = _SIDE * (2 * (way - row) - 1) * (-1) ** row
        pose = around(
            _FRONT + along,
            _ROWS[row] + random.normal(0, 1.5),
            distance * (1 + random.uniform(-0.08, 0.08)),
            random.uniform(-0.1, 0.1, 3),
        )
        roll = math.radians(random.normal(0, 1))
        turn = np.array([[math.cos(roll), -math.sin(roll)], [math.sin(roll), math.cos(roll)]])
        pose[:3, :2] = pose[:3, :2] @ turn
        poses.append(pose)
    return poses
