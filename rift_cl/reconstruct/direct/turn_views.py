"""Views of a circular scan in order, so that a sinogram can be read between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import real_numbers

Floats = NDArray[np.float64]
Stack = NDArray[np.float32]

# Views that are repeated beyond the ends of a full turn, more than a cubic spline's reach.
_BORDER = 12
# A full turn may lack a view and a half.
_TURN_SLACK = 1.5
# Angles closer than this are the same, in radians.
_SAME = 1e-6


class TurnViews(NamedTuple):
    """Views in ascending order, some of a full turn's repeated beyond its ends.

    Rays are read from ``first`` to ``last``, which for a full turn are the same direction.
    """

    angles: Floats
    order: NDArray[np.intp]
    turn: bool
    first: float
    last: float

    @property
    def step(self) -> float:
        """The median distance of neighbouring views, in radians."""
        return float(np.median(np.diff(self.angles)))


def in_one_turn(angles: ArrayLike) -> tuple[Floats, NDArray[np.intp]]:
    """The distinct angles of views, those of further turns brought into the first; ascending.

    Returns:
        (n,) angles, and (views,) which of them each view has.
    """
    values = real_numbers(angles)
    if values is None or values.ndim != 1 or values.size < 1 or not np.isfinite(values).all():
        raise InputError("angles of a fan scan are wanted as finite numbers, in radians")
    if np.ptp(values) > 2 * np.pi + _SAME:
        lowest = values.min()
        values = lowest + np.mod(values - lowest + _SAME, 2 * np.pi) - _SAME
    order = np.argsort(values, kind="stable")
    new = np.concatenate([[True], np.diff(values[order]) > _SAME])
    group = np.empty(values.size, np.intp)
    group[order] = np.cumsum(new) - 1
    return values[order][new], group


def means(stack: Stack, group: NDArray[np.intp]) -> Stack:
    """The mean of the views of each group."""
    sums = np.zeros((group.max() + 1, *stack.shape[1:]))
    np.add.at(sums, group, stack)
    counts = np.bincount(group).reshape((-1,) + (1,) * (stack.ndim - 1))
    return (sums / counts).astype(np.float32)


def turn_views(ascending: Floats) -> TurnViews:
    """Distinct angles in ascending order, continued beyond the ends of a full turn.

    Raises:
        InputError: there are fewer than two.
    """
    if ascending.size < 2:
        raise InputError("the fan scan has views of one angle alone, wanted two or more angles")
    span, step = np.ptp(ascending), np.median(np.diff(ascending))
    order = np.arange(ascending.size)
    if span < 2 * np.pi - _TURN_SLACK * step:
        return TurnViews(ascending, order, False, float(ascending[0]), float(ascending[-1]))
    once = ascending < ascending[0] + 2 * np.pi - step / 2
    ascending, order = ascending[once], order[once]
    border, first = min(_BORDER, ascending.size), float(ascending[0])
    beyond = [ascending[-border:] - 2 * np.pi, ascending, ascending[:border] + 2 * np.pi]
    order = np.concatenate([order[-border:], order, order[:border]])
    return TurnViews(np.concatenate(beyond), order, True, first, first + 2 * np.pi)


def resampled(sinogram: Stack, places: list[tuple[Floats, Floats]], order: int) -> Stack:
    """A sinogram read at places between its samples, with splines.

    Args:
        sinogram: (view, bin).
        places: each (2, ...) fractional view and bin, and (...) the weights of what is read there,
            which are summed; nothing is read where they are 0.
        order: of the splines: 1 or 3.
    """
    from scipy.ndimage import map_coordinates, spline_filter1d

    smooth = sinogram.astype(np.float64)
    if order > 1:
        for axis in (0, 1):
            smooth = spline_filter1d(smooth, order, axis=axis, mode="mirror")
    total = np.zeros(places[0][1].shape)
    for place, weight in places:
        used = weight > 0
        values = map_coordinates(
            smooth, place[:, used], order=order, mode="mirror", prefilter=False
        )
        total[used] += weight[used] * values
    return total.astype(np.float32)
