"""The distinct directions among a scan's views, on the half-circle that they share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import real_numbers

Floats = NDArray[np.float64]
# Directions closer than this are the same: the rounding of angles of a thousand turns.
_SAME = 1e-9
# Views beside a gap as wide as this still stand for what is in it, as those of half acquisitions do
# (rift_cl/reconstruct/direct/offset_axis.py). A hole is so many times wider than each of so many
# gaps on either side: clusters of a few views and random angles have their like nearby.
_HOLE, _APART, _NEAR = np.pi / 12, 3.0, 5


@dataclass(frozen=True, eq=False)
class Directions:
    """Distinct directions; a direction and its opposite are one.

    Args:
        angles: (n,) radians in 0 .. pi, rising.
        gaps: (n,) from each direction to the next, half a turn on after the last; they add up
            to pi.
        group: (views,) which of them each view has.
    """

    angles: Floats
    gaps: Floats
    group: NDArray[np.intp]

    @classmethod
    def of(cls, angles: ArrayLike) -> Directions:
        """Find the distinct directions of views.

        Args:
            angles: (views,) radians, any order, any range.

        Raises:
            ShapeError: there is none, or the array has another shape.
            InputError: an angle is not a finite real number.
        """
        values = real_numbers(angles)
        if values is None:
            raise InputError("angles: wanted real numbers, in radians")
        if values.ndim != 1 or not values.size:
            raise ShapeError(f"angles has shape {values.shape}, wanted (views,) with one or more")
        if not np.isfinite(values).all():
            raise NonFiniteError("angles holds NaN or infinity, wanted finite radians")
        directions = np.mod(values, np.pi)
        order = np.argsort(directions, kind="stable")
        rising = directions[order]
        gaps = np.diff(rising, append=rising[0] + np.pi)
        steps = gaps > _SAME
        count = max(int(np.count_nonzero(steps)), 1)
        group = np.empty(len(values), np.intp)
        # The last direction may be the first one, half a turn on.
        group[order] = np.concatenate([[0], np.cumsum(steps[:-1])]) % count
        first = np.concatenate([[0], np.flatnonzero(steps[:-1]) + 1])[:count]
        return cls(rising[first], gaps[steps] if steps.any() else np.array([np.pi]), group)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.angles)

    @property
    def holes(self) -> NDArray[np.bool_]:
        """(n,) which gaps are holes in the scan, as the missing wedge is.

        A hole is wider than 15 degrees and than three times each of the five gaps on either side
        of it. So neither the steps of the coarse part of a scan are holes, nor those of few views.
        """
        holes = (self.gaps > _HOLE) & (len(self) > 1)
        for steps in range(1, min(_NEAR, len(self) - 1) + 1):
            for beside in (np.roll(self.gaps, steps), np.roll(self.gaps, -steps)):
                holes &= self.gaps > _APART * beside
        return holes

    def share(self, values: Floats) -> Floats:
        """What is a direction's, (n, ...), in equal parts to its views, (views, ...)."""
        counts = np.bincount(self.group).reshape((-1,) + (1,) * (values.ndim - 1))
        parts: Floats = (values / counts)[self.group]
        return parts
