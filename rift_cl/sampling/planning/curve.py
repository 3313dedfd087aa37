"""What a family of paths is to the planner: places as a function of a few numbers.

A curve gives azimuth, elevation and the share of the way from the nearest to the farthest distance,
(V, 3), for a vector of numbers; and several vectors from which a search may begin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """A family of paths.

    Args:
        angles: from numbers (n,) and the count of views to azimuth, elevation, share of distance.
        starts: vectors of numbers (n,) to begin from.
        low: (n,) lowest numbers.
        high: (n,) highest numbers.
    """

    angles: Callable[[Floats, int], Floats]
    starts: list[Floats]
    low: Floats
    high: Floats
