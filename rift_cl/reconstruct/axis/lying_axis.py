"""Whether a cone's axis lies along the detector's rows: rows were taken for bins.

Whatever turns about the columns moves along the rows, much, and from row to row little: by the
change of its magnification. What all bins of a row see together hence stays nearly the same from
view to view, as in parallel beams, where it is the mass of a slice (D. Ludwig, Comm. Pure Appl.
Math. 19, 49, 1966), while what all rows of a bin see together changes. Where it is the other way
round, rows and bins are swapped. A body that is round about its axis tells nothing, and one that
drifts along it too little to count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Cone
from rift_cl.reconstruct.axis.views import Views

# Views, and rows and bins, that are looked at, at most, and at least.
_VIEWS, _PLACES, _FEWEST = 48, 64, 8
# The energy by which rows change is so many times that of bins, and its root this share of the
# contrast, in scans whose rows and bins are swapped.
_TIMES, _LEAST = 3.0, 0.05


def looked_at(scan: Cone) -> tuple[list[int], list[int]]:
    """The views and the rows that ``lying_axis`` wants to see: some, evenly spread."""
    return _some(scan.views, _VIEWS), _some(scan.rows, _PLACES)


def _some(count: int, most: int) -> list[int]:
    taken = min(count, most)
    return [int((index + 0.5) * count / taken) for index in range(taken)]


def lying_axis(seen: Views) -> str:
    """What views say against rows that are rows.

    Args:
        seen: (view, row, bin) of a circular scan, line integrals but for what all views share.

    Returns:
        The end of a sentence; empty where nothing.
    """
    if min(seen.shape) < _FEWEST:
        return ""
    parts = [part.mean(axis=2) for part in np.array_split(seen, min(_PLACES, seen.shape[2]), 2)]
    values: NDArray[np.float64] = np.stack(parts, axis=2).astype(np.float64)
    changes = values - values.mean(axis=0)
    by_row, by_bin = (float((changes.mean(axis=axis) ** 2).mean()) for axis in (2, 1))
    if by_row <= max(_TIMES * by_bin, (_LEAST * values.std()) ** 2):
        return ""
    return (
        "the detector's rows change from view to view, and its bins hardly, as if the axis lay "
        "along the rows: rows and bins are probably swapped (--axes angle,bin,row, or turn the "
        "images)"
    )
