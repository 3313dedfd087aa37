"""What is told of the directions that a scan lacks, and which no method makes up for."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.operators.filters.directions import Directions

# Holes whose places a sentence lists at most.
_MOST = 3


def missing_directions(angles: ArrayLike) -> list[str]:
    """A sentence about the holes among the directions of parallel views; none where none is.

    Args:
        angles: of the views, in radians.
    """
    directions = Directions.of(angles)
    holes = directions.holes
    if not holes.any():
        return []
    begins, widths = np.rad2deg(directions.angles[holes]), np.rad2deg(directions.gaps[holes])
    ends = zip(begins, begins + widths, strict=True)
    places = [f"{first:.4g} to {last:.4g}" for first, last in ends]
    where = " and ".join(places) if len(places) <= _MOST else f"{len(places)} gaps"
    return [
        f"{widths.sum():.0f} of 180 degrees have no view ({where}; limited angle): edges in these "
        "directions are blurred."
    ]
