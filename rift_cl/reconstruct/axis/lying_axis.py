"""Whether a cone's axis lies along the detector's rows: rows were taken for bins.

Whatever turns about the columns moves along the rows, much, and from row to row little: by the
change of its magnification. What all bins of a row see together hence stays nearly the same from
view to view, as in parallel beams, where it is the mass of a slice (D. Ludwig, Comm. Pure Appl.
Math. 19, 49, 1966), while what all rows of a bin see together changes. Where it is the other way
round, rows and bins are swapped. A body that is round about its axis tells nothing, and one that
drifts along it too little to count.

In a wide cone thin layers beside the orbit's plane move from row to row as well. Where a turn has
opposite rays, these therefore have the last word: those of a row agree, and those of a column do
not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Cone, Fan
from rift_cl.reconstruct.axis.fan_doubt import disagreement
from rift_cl.reconstruct.axis.views import Views

# Views, and rows and bins, that are looked at, at most, and at least.
_VIEWS, _PLACES, _FEWEST = 48, 64, 8
# The energy by which rows change is so many times that of bins, and its root this share of the
# contrast, in scans whose rows and bins are swapped. In cones of half-angles of 30 degrees that of
# right scans reaches 0.65 of that of bins.
_TIMES, _LEAST = 1.5, 0.05


def looked_at(scan: Cone) -> tuple[list[int], list[int]]:
    """The views and the rows that ``lying_axis`` wants to see: some, evenly spread."""
    return _some(scan.views, _VIEWS), _some(scan.rows, _PLACES)


def _some(count: int, most: int) -> list[int]:
    taken = min(count, most)
    return [int((index + 0.5) * count / taken) for index in range(taken)]


def lying_axis(seen: Views, scan: Cone) -> str:
    """What views say against rows that are rows.

    Args:
        seen: (view, row, bin), line integrals but for what all views share; of the views and the
            rows that are ``looked_at``.
        scan: the circular scan, of all views and rows.

    Returns:
        The end of a sentence; empty where nothing.
    """
    if min(seen.shape) < _FEWEST:
        return ""
    parts = [part.mean(axis=2) for part in np.array_split(seen, min(_PLACES, seen.shape[2]), 2)]
    values: NDArray[np.float64] = np.stack(parts, axis=2).astype(np.float64)
    changes = values - values.mean(axis=0)
    # What a whole view has more, of the beam or of an object nearer to the source, is in both.
    changes -= changes.mean(axis=(1, 2), keepdims=True)
    by_row, by_bin = (float((changes.mean(axis=axis) ** 2).mean()) for axis in (2, 1))
    if by_row <= max(_TIMES * by_bin, (_LEAST * values.std()) ** 2):
        return ""
    of_row = _disagreement_of_a_row(seen, scan)
    if np.isfinite(of_row) and of_row <= _disagreement_of_a_column(seen, scan):
        return ""
    return (
        "the detector's rows change from view to view, and its bins hardly, as if the axis lay "
        "along the rows: rows and bins are probably swapped (--axes angle,bin,row, or turn the "
        "images)"
    )


def _disagreement_of_a_row(seen: Views, scan: Cone) -> float:
    """Of opposite rays of the row nearest to the orbit's."""
    views, rows = looked_at(scan)
    row = int(np.abs(np.array(rows) - scan.center[0]).argmin())
    return _in_either_sense(seen[:, row], scan.fan().subset(np.array(views)))


def _disagreement_of_a_column(seen: Views, scan: Cone) -> float:
    """The same of the column nearest to the axis, if it were a row."""
    views, rows = looked_at(scan)
    column = round(min(max(scan.center[1], 0), scan.bins - 1))
    step = scan.rows / len(rows)
    fan = Fan(
        scan.angles[views],
        len(rows),
        scan.pitch[0] * step,
        scan.source_to_axis,
        scan.source_to_detector,
        (scan.center[0] + 0.5) / step - 0.5,
    )
    return _in_either_sense(seen[:, :, column], fan)


def _in_either_sense(sinogram: Views, fan: Fan) -> float:
    return min(disagreement(sinogram, fan.at(sign * fan.angles)) for sign in (1, -1))
