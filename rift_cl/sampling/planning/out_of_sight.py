"""Places from which a target is not seen, as the planner keeps out of them.

What stands in the way has no simple shape. Places all round the target are asked instead, and what
lies nearer to one that is shut than to one that is open is taken to be shut.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.sampling.targets.free_space import FreeSpace
from rift_cl.sampling.targets.prior import directions_for

Floats = NDArray[np.float64]
# Directions all round that are asked, and shells between the nearest and the farthest distance.
_DIRECTIONS, _SHELLS = 800, 4
# Share of the target's outline that has to be in sight.
_SIGHT = 0.5


@dataclass(frozen=True, eq=False)
class OutOfSight:
    """The places that are nearer to a shut one than to an open one.

    Args:
        open: (n, 3) places where cameras may stand.
        shut: (m, 3) places where none may.
        margin: how far cameras stay off what is between.

    Raises:
        InputError: there is no open place, or no shut one.
    """

    open: Floats
    shut: Floats
    margin: float = 0.0

    def __post_init__(self) -> None:
        """Check that there are both."""
        if not len(self.open) or not len(self.shut):
            raise InputError("OutOfSight: wanted places of both kinds, open and shut")

    @cached_property
    def _trees(self) -> tuple[Any, Any]:
        from scipy.spatial import cKDTree

        return cKDTree(self.open), cKDTree(self.shut)

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """About the distance of points (n, 3) from what is shut, (n,), and its gradient, (n, 3)."""
        ways = []
        for tree in self._trees:
            apart, index = tree.query(points)
            unit = (points - tree.data[index]) / np.maximum(apart, 1e-300)[:, None]
            ways.append((apart, unit))
        (to_open, from_open), (to_shut, from_shut) = ways
        return (to_shut - to_open) / 2 - self.margin, (from_shut - from_open) / 2


def places_about(center: ArrayLike, near: float, far: float) -> tuple[Floats, float]:
    """Places evenly all round a point, (n, 3), on shells; and how far they are apart at the most.

    Args:
        center: (3,) the point.
        near: radius of the first shell.
        far: of the last.
    """
    half = directions_for(3, _DIRECTIONS // 2)
    ways = np.concatenate([half, -half])
    shells = np.geomspace(near, far, _SHELLS) if far > 1.02 * near else np.array([near])
    places = np.asarray(center, np.float64) + (shells[:, None, None] * ways).reshape(-1, 3)
    return places, float(far * math.sqrt(4 * math.pi / _DIRECTIONS))


def out_of_sight(
    space: FreeSpace, center: ArrayLike, radius: float, near: float, far: float
) -> OutOfSight | None:
    """Positions inside an object or occluded from the target; None if there are none.

    Args:
        space: what pictures show of what stands where.
        center: (3,) the target's middle.
        radius: of the target.
        near: least distance of cameras from the middle.
        far: largest distance.

    Raises:
        InputError: the target is seen from nowhere.
    """
    places, step = places_about(center, near, far)
    clear = space.in_sight(places, center, radius) >= _SIGHT
    if not clear.any():
        raise InputError(
            "the depth of the pictures leaves no place from which the target is seen: check its "
            "centre and diameter"
        )
    return None if clear.all() else OutOfSight(places[clear], places[~clear], step / 2)
