"""Vectors that are a cone's but for small tilts, and images turned over or mirrored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rift_cl.errors import InputError
from rift_cl.geometry.cone import Cone
from rift_cl.geometry.vectors import Vectors

# How far sources, or the detector's corners, may stand from where the cone has them, as a share of
# the detector's longer side.
_NEAR = 0.05


def nearly_upright(vectors: Vectors) -> tuple[Cone, bool, bool] | None:
    """The circular cone that has nearly the same rays.

    Args:
        vectors: places of source and detector.

    Returns:
        The cone, whether its rows run the other way than those of the vectors, and whether its bins
        do; None where there is no such cone.
    """
    tolerance = _NEAR * max(vectors.rows, vectors.bins)
    for turned_over in (False, True):
        for mirrored in (False, True):
            down = -vectors.down if turned_over else vectors.down
            across = -vectors.across if mirrored else vectors.across
            try:
                cone = Cone.of_vectors(replace(vectors, down=down, across=across), tolerance)
            except InputError:
                continue
            rise = np.ptp(cone.heights) * cone.magnification / cone.pitch[0]
            if rise <= tolerance:
                level = np.full(cone.views, np.median(cone.heights))
                return replace(cone, heights=level), turned_over, mirrored
    return None
