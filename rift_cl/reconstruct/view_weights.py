"""How much of the half-circle of directions each view stands for.

A reconstruction by integration is a sum over directions; the weights here are its quadrature.
They always add up to pi, so that the level of the result is right whatever the directions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError

Floats = NDArray[np.float64]
# Directions are taken for an even cover of the half-circle while no gap exceeds this many means.
_EVEN = 2.0


def view_weights(angles: Floats, compensate: str | None = None) -> Floats:
    """Quadrature weights of views.

    Args:
        angles: directions in radians, any order; a direction and its opposite are the same.
        compensate: ``voronoi``: each view stands for the directions that are nearest to it.
            None: the same where the directions cover the half-circle evenly, so that double
            cover and a closed end count once; equal weights where they leave larger gaps, since
            the views beside a gap know no more about it than the others.

    Returns:
        (angles,) weights, which add up to pi.

    Raises:
        InputError: the compensation is unknown.
    """
    if compensate not in (None, "voronoi"):
        raise InputError(f"compensate is {compensate!r}, wanted None or 'voronoi'")
    order = np.argsort(np.mod(angles, np.pi), kind="stable")
    directions = np.mod(angles, np.pi)[order]
    gaps = np.diff(directions, append=directions[0] + np.pi)
    if compensate is None and gaps.max() > _EVEN * np.pi / np.count_nonzero(_distinct(gaps)):
        return np.full(len(angles), np.pi / len(angles))
    weights = np.empty(len(angles))
    weights[order] = (gaps + np.roll(gaps, 1)) / 2
    return weights


def _distinct(gaps: Floats) -> NDArray[np.bool_]:
    """Gaps between different directions, told from rounding by the float64 of an angle."""
    return gaps > 1e-9
