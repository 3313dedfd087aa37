"""Weights of unevenly spaced views: the part of the half-circle that each represents.

A reconstruction by integration is a sum over directions; the weights here are its quadrature. What
lies in a hole of the scan is nobody's: weighed by half of it, the two views beside it would draw
streaks across the image. They add up to pi, so that the level of the result is right: one number
for each view, or, where it depends on frequency what a view knows, a function of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.directions import Directions

Floats = NDArray[np.float64]
# Compensations that are one number for each view, the simplest first.
WAYS = "uniform", "voronoi", "covered"
# Weights that differ by no more than this share of themselves are even: angles are often float32.
_EVEN = 1e-4


def view_weights(angles: Floats, compensate: str | None = None) -> Floats:
    """Quadrature weights of views.

    Args:
        angles: directions in radians, any order; a direction and its opposite are the same, and
            views of the same direction share its weight.
        compensate: ``voronoi``: each direction stands for those that are nearest to it.
            ``covered``: the same, but for holes (``Directions.holes``), as the missing wedge of a
            tilt series: of these the views beside them know no more than the others, and so stand
            for as much on that side as on their other one. ``uniform``: every view weighs the
            same. None: ``covered``.

    Returns:
        (angles,) weights, which add up to pi.

    Raises:
        InputError: the compensation is unknown, or one that depends on frequency.
    """
    if compensate not in (None, *WAYS):
        names = ", ".join(map(repr, (*WAYS, *COMPENSATIONS)))
        raise InputError(f"compensate is {compensate!r}, wanted None or one of {names}")
    even = np.full(len(angles), np.pi / len(angles))
    if compensate == "uniform":
        return even
    directions = Directions.of(angles)
    gaps = directions.gaps
    if compensate == "voronoi" or not directions.holes.any():
        return directions.share((gaps + np.roll(gaps, 1)) / 2)
    weights = directions.share(_covered(directions))
    return even if np.ptp(weights) <= _EVEN * even[0] else weights


def _covered(directions: Directions) -> Floats:
    """What each direction stands for where there are holes, (n,), pi in all."""
    gaps, holes = directions.gaps, directions.holes
    before = np.roll(gaps, 1)
    # No two holes are neighbours.
    sides = np.where(holes, before, gaps) + np.where(np.roll(holes, 1), gaps, before)
    shares: Floats = sides * (np.pi / sides.sum())
    return shares


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
