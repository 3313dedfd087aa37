"""What the pixels of tilted detectors read of upright ones, as a matrix.

A pixel's ray is followed to the plane of the upright detector behind the same source, and the view
there is interpolated along rows and columns: by Keys' cubic (R. G. Keys, IEEE Trans. ASSP 29, 1153,
1981), or by the cubic spline through its samples.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Samples beyond the outer ones that are read as these are by the spline, with a rounding.
_BEYOND = 0.51


def reading_matrix(places: Floats, rows: int, bins: int, *, spline: bool = False) -> Any:
    """The matrix from an upright view to the pixels that see these places.

    Args:
        places: (row, column) of each pixel's ray on the upright detector, (pixels, 2).
        rows: of the upright detector.
        bins: of each of its rows.
        spline: interpolate by the cubic spline in the place of Keys' cubic.

    Returns:
        (pixels, rows * bins) float64; pixels that are not wholly inside read nothing. Of the
        spline those within half a sample of the outer ones read these.
    """
    size = np.array([rows, bins])
    if spline:
        inside = np.asarray(((places >= -_BEYOND) & (places <= size - 1 + _BEYOND)).all(axis=1))
        by_row, by_column = (
            cubic_b_spline(np.clip(places[:, axis, None], 0, n - 1) - np.arange(-2, n + 2))
            @ spline_factors(n)
            for axis, n in enumerate(size.tolist())
        )
    else:
        inside = np.asarray(((places >= 1) & (places < size - 2)).all(axis=1))
        by_row, by_column = (keys(places[:, n, None] - np.arange(size[n])) for n in (0, 1))
    weights = by_row[:, :, None] * by_column[:, None, :] * inside[:, None, None]
    return weights.reshape(len(places), -1)


def keys(distance: Floats) -> Floats:
    """Keys' cubic: 1 at 0, 0 at all other whole numbers and beyond 2."""
    d = np.abs(distance)
    near = 1 + d**2 * (1.5 * d - 2.5)
    far = 2 + d * (-4 + d * (2.5 - 0.5 * d))
    weights: Floats = np.where(d < 1, near, np.where(d < 2, far, 0))
    return weights


def cubic_b_spline(distance: Floats) -> Floats:
    """The cubic B-spline about 0."""
    d = np.abs(distance)
    near, far = (4 + d**2 * (3 * d - 6)) / 6, np.maximum(0, 2 - d) ** 3 / 6
    weights: Floats = np.where(d < 1, near, far)
    return weights


def spline_factors(count: int) -> Floats:
    """The matrix from samples, zero beyond their ends, to the factors of the B-splines.

    Args:
        count: of samples; the factors are theirs, and those of two places beyond either end.
    """
    away = np.abs(np.arange(-2, count + 2)[:, None] - np.arange(count))
    factors: Floats = np.sqrt(3) * (np.sqrt(3) - 2.0) ** away
    return factors


def places_on_plane(
    rays: Floats, foot: Floats, along: Floats, up: Floats, normal: Floats
) -> Floats:
    """Where rays from the source meet a plane, (row, column) in its steps.

    Args:
        rays: directions, (n, 3).
        foot: from the source to where row 0 and column 0 are counted from.
        along: from column to column.
        up: from row to row, at a right angle to ``along``.
        normal: of the plane.
    """
    meets = rays * ((foot @ normal) / (rays @ normal))[:, None] - foot
    columns, rows = meets @ along / (along @ along), meets @ up / (up @ up)
    return np.stack([rows, columns], axis=1)
