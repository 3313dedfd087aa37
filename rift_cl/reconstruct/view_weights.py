"""How much of the half-circle of directions each view stands for.

A reconstruction by integration is a sum over directions; the weights here are its quadrature.
They always add up to pi, so that the level of the result is right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError

Floats = NDArray[np.float64]
# Views cover the half-circle while no gap between directions exceeds twice the mean gap, or 5
# degrees. Beyond that a gap is a hole, and its neighbours know no more about it than the others.
_HOLE_MEANS = 2.0
_HOLE = np.pi / 36
# Directions closer than this are the same: the rounding of angles of a thousand turns.
_SAME = 1e-9


def view_weights(angles: Floats, compensate: str | None = None) -> Floats:
    """Quadrature weights of views.

    Args:
        angles: directions in radians, any order; a direction and its opposite are the same, and
            views of the same direction share its weight.
        compensate: ``voronoi``: each direction stands for those that are nearest to it.
            None: the same where the directions cover the half-circle (no gap exceeds twice the
            mean or 5 degrees), else the same weight for every view.

    Returns:
        (angles,) weights, which add up to pi.

    Raises:
        InputError: the compensation is unknown.
    """
    if compensate not in (None, "voronoi"):
        raise InputError(f"compensate is {compensate!r}, wanted None or 'voronoi'")
    group, gaps = _distinct_directions(angles)
    if compensate is None and gaps.max() > max(_HOLE_MEANS * np.pi / gaps.size, _HOLE):
        return np.full(len(angles), np.pi / len(angles))
    shares = (gaps + np.roll(gaps, 1)) / 2
    weights: Floats = (shares / np.bincount(group))[group]
    return weights


def _distinct_directions(angles: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Which distinct direction each view has, and the gap from each of those to the next."""
    directions = np.mod(angles, np.pi)
    order = np.argsort(directions, kind="stable")
    gaps = np.diff(directions[order], append=directions[order[0]] + np.pi)
    steps = gaps > _SAME
    group = np.empty(len(angles), np.intp)
    # The last direction may be the first one, half a turn on.
    group[order] = np.concatenate([[0], np.cumsum(steps[:-1])]) % max(np.count_nonzero(steps), 1)
    return group, gaps[steps] if steps.any() else np.array([np.pi])
