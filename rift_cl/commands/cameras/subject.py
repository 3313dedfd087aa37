"""What a capture is of: the surface that most photographs have in their middle.

The point that the cameras' axes pass nearest to, their focus, tells it only roughly: people turn
about the wall and aim at what hangs on it, so that a film that looks at the focus cuts off what
stands out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.targets.free_space import DepthMap

Floats = NDArray[np.float64]

# Half the middle of a picture, as a share of its shorter edge.
_MIDDLE = 0.15


def subject_of(maps: Sequence[DepthMap]) -> Floats | None:
    """The median (3,) of the surface points in the middle of pictures, or None where none shows.

    Args:
        maps: how far off what pictures show is.
    """
    points = [point for point in map(_in_the_middle, maps) if point is not None]
    return np.median(points, axis=0) if points else None


def _in_the_middle(one: DepthMap) -> Floats | None:
    """The point on a picture's axis as far off as what surrounds it, in the median."""
    rows, columns = one.depth.shape
    reach = max(1, round(_MIDDLE * min(rows, columns)))
    middle = one.depth[
        max(0, rows // 2 - reach) : rows // 2 + reach + 1,
        max(0, columns // 2 - reach) : columns // 2 + reach + 1,
    ]
    depths = middle[np.isfinite(middle)]
    if not depths.size:
        return None
    point: Floats = one.camera.center + np.median(depths) * one.camera.view[2, :3]
    return point
