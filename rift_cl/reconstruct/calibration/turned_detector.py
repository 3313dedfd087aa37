"""A flat detector turned about the foot of the source, in its plane and about its columns."""

from __future__ import annotations

import numpy as np

from rift_cl.geometry import Cone, Vectors


def turned(scan: Cone, roll: float, slant: float = 0.0) -> Vectors:
    """A flat cone whose detector is turned about the pixel at ``center``.

    Args:
        scan: the cone with an upright detector.
        roll: in its plane, in radians; positive where the axis is then seen at greater bins in
            greater rows.
        slant: about its columns, in radians; positive where greater bins are then farther from the
            source.
    """
    straight = scan.vectors()
    turn = scan.pitch[1] / scan.pitch[0]
    off = (np.array([scan.rows, scan.bins]) - 1) / 2 - scan.center
    foot = straight.middle - off[0] * straight.down - off[1] * straight.across
    ahead = foot - straight.source
    ahead = ahead * (scan.pitch[1] / np.linalg.norm(ahead, axis=1, keepdims=True))
    level = np.cos(slant) * straight.across + np.sin(slant) * ahead
    across = np.cos(roll) * level + np.sin(roll) * turn * straight.down
    down = np.cos(roll) * straight.down - np.sin(roll) / turn * level
    middle = foot + off[0] * down + off[1] * across
    return Vectors(straight.source, middle, across, down, scan.rows, scan.bins)
