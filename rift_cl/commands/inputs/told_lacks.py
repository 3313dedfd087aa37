"""What is told of the directions and the rays that a scan lacks, whatever is made of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.geometry import Cone, Parallel
from rift_cl.operators.filters.directions import Directions
from rift_cl.reconstruct.direct.offset_axis import (
    is_full_turn,
    is_offset,
    sees_further,
    shows_both_sides,
)
from rift_cl.reconstruct.direct.padding import is_truncated

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


def missing_rays(
    projections: NDArray[np.float32], scan: Parallel | Cone, remedy: str = ""
) -> list[str]:
    """A sentence about an object that is wider than the detector; none where it is not.

    Args:
        projections: line integrals, (angle, row, bin), air at 0.
        scan: their geometry. What views of a turn miss beyond one side others show.
        remedy: what explains such rays, in words.
    """
    if isinstance(scan, Cone):
        center, further = scan.center[1], sees_further(scan.center[1], scan.bins)
        opposite = further and is_full_turn(scan.angles)
    else:
        center, further = scan.center, is_offset(scan)
        opposite = shows_both_sides(scan)
    if not is_truncated(projections, center if opposite else None):
        return []
    return [
        f"The object reaches beyond {'the farther side' if further else 'a side'} of the detector "
        "in most views: values near the border of the field of view are too large"
        f"{f' ({remedy})' if remedy else ''}."
    ]
