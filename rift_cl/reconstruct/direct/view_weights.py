"""Weights of unevenly spaced views: the part of the half-circle that each represents.

A reconstruction by integration is a sum over directions; the weights here are its quadrature.
They add up to pi, so that the level of the result is right: one number for each view, or, where
it depends on frequency what a view knows, a function of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.directions import Directions

Floats = NDArray[np.float64]
# Views cover the half-circle while no gap between directions exceeds twice the mean gap, or 5
# degrees. Beyond that a gap is a hole, and its neighbours know no more about it than the others.
_HOLE_MEANS = 2.0
_HOLE = np.pi / 36


def view_weights(angles: Floats, compensate: str | None = None) -> Floats:
    """Quadrature weights of views.

    Args:
        angles: directions in radians, any order; a direction and its opposite are the same, and
            views of the same direction share its weight.
        compensate: ``voronoi``: each direction stands for those that are nearest to it.
            ``uniform``: every view weighs the same. None: as ``voronoi`` where the directions
            cover the half-circle (no gap exceeds twice the mean or 5 degrees), else ``uniform``.

    Returns:
        (angles,) weights, which add up to pi.

    Raises:
        InputError: the compensation is unknown, or one that depends on frequency.
    """
    if compensate not in (None, "voronoi", "uniform"):
        names = ", ".join(map(repr, ("uniform", "voronoi", *COMPENSATIONS)))
        raise InputError(f"compensate is {compensate!r}, wanted None or one of {names}")
    directions = Directions.of(angles)
    gaps = directions.gaps
    holes = gaps.max() > max(_HOLE_MEANS * np.pi / gaps.size, _HOLE)
    if compensate == "uniform" or (compensate is None and holes):
        return np.full(len(angles), np.pi / len(angles))
    return directions.share((gaps + np.roll(gaps, 1)) / 2)


def view_gains(angles: Floats, compensate: str | None, diameter: float) -> Floats | Compensation:
    """Quadrature weights of views, or the function of frequency that they are.

    Args:
        angles: see ``view_weights``.
        compensate: what ``view_weights`` takes, or ``capped-voronoi``, ``pipe-menon`` or
            ``exact``, which depend on frequency (rift_cl/operators/filters/compensation.py).
        diameter: of the object, for these.

    Raises:
        InputError: the compensation is unknown, or the diameter no length.
    """
    if compensate is not None and compensate in COMPENSATIONS:
        return Compensation(angles, compensate, diameter)
    return view_weights(angles, compensate)
