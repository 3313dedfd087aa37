"""The density of additive splats at points of space, in double precision, off every clock."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from bases.additive import Floats, Geometry
from bases.mode_sets import ModeSet
from rift_cl.basis import Hermite

# In standard deviations; modes up to order 4 have fallen to 1e-5 of their peak.
_REACH = 6.5


def density(geometry: Geometry, modes: ModeSet, coefficients: Floats, points: Floats) -> Floats:
    """The sum of splats with coefficients (N, K, 1) at points (P, 3): (P,)."""
    basis, total = Hermite(modes.order, 3), np.zeros(len(points))
    full = np.einsum("mk,nk->nm", modes.matrix, coefficients[..., 0])
    turns = Rotation.from_quat(np.roll(geometry.quats, -1, axis=1)).as_matrix()
    scales = np.exp(geometry.log_scales)
    tree = cKDTree(points)
    near = tree.query_ball_point(geometry.means, _REACH * scales.max(axis=1))
    for mean, turn, scale, c, mine in zip(geometry.means, turns, scales, full, near, strict=True):
        if mine:
            own = (points[mine] - mean) @ turn / scale
            total[mine] += basis.evaluate(c, own)
    return total
