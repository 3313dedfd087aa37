"""What is opaque: the sides of a target that can be looked at, and which of them pictures show.

A sphere stands for the surface. Of its sides those count from which a camera, as far off as those
at hand, would see the target; what faces a wall does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rift_cl.commands.inputs.view_set import Floats, ViewSet
from rift_cl.errors import InputError
from rift_cl.sampling.planning.keep_out import KeepOut
from rift_cl.sampling.planning.out_of_sight import OutOfSight, out_of_sight, places_about
from rift_cl.sampling.targets.free_space import FreeSpace
from rift_cl.sampling.targets.prior import directions_for
from rift_cl.sampling.targets.target import Target

# Sides that are looked at, and those that a plan or a suggestion counts with.
_SIDES, SURFACE = 400, 24
# A side is seen by a view within so much of straight on; beyond, it is squeezed to less than half.
SQUARE = 60.0
# How far off the cameras at hand others are suggested where nothing tells what stands where.
ASTRAY = 15.0
# Share of the cameras at hand that must see the target by the depth, or it is not to be trusted.
_TRUSTED = 0.8


@dataclass(frozen=True, eq=False)
class Sides:
    """Shares of all sides of a target.

    Args:
        shut: from which it cannot be looked at, since something stands in the way.
        unseen: of the others, those that no view sees within ``SQUARE`` degrees.
        seen_once: of the others, those that a single view sees.
        gap: degrees from the side that lies farthest from all views to the nearest of them.
        farthest: (3,) the direction of that side.
    """

    shut: float
    unseen: float
    seen_once: float
    gap: float
    farthest: Floats


def trusted(space: FreeSpace | None, sampled: ViewSet) -> bool:
    """Whether most cameras at hand see the target by what depth says."""
    if space is None:
        return False
    target = sampled.target
    places = np.array([camera.center for camera in sampled.cameras])
    clear = space.in_sight(places, target.center, target.diameter / 2)
    return float(np.mean(clear >= 0.5)) >= _TRUSTED


def hidden_places(sampled: ViewSet, near: float, far: float) -> KeepOut | None:
    """Where no camera sees the target, between two distances from it; None for nowhere.

    Raises:
        InputError: it is seen from nowhere.
    """
    if sampled.space is None:
        return None
    target = sampled.target
    shape = out_of_sight(sampled.space, target.center, target.diameter / 2, near, far)
    return None if shape is None else KeepOut(shape)


def strange_places(sampled: ViewSet, distance: float) -> KeepOut | None:
    """Positions far from all cameras, about which nothing is known."""
    places, step = places_about(sampled.target.center, distance, distance)
    ways = (places - sampled.target.center) / distance
    near = (ways @ sampled.directions().T).max(axis=1) >= math.cos(math.radians(ASTRAY))
    if near.all():
        return None
    return KeepOut(OutOfSight(places[near], places[~near], step / 4))


def surface_of(sampled: ViewSet, distance: float) -> Target:
    """A sphere for the target's surface, without the sides that cannot be looked at.

    Args:
        sampled: the views, and what stands where.
        distance: of cameras from the target's middle.
    """
    ways = _open_ways(sampled, distance, SURFACE)
    target = sampled.target
    return replace(
        target,
        points=target.center + target.diameter / 2 * ways,
        normals=ways,
        mode="surface",
        frequencies=None,
    )


def sides_of(sampled: ViewSet, distance: float) -> Sides:
    """Which sides of the target pictures show; arguments as ``surface_of``.

    Sides that are seen from below the horizon are left out where no camera stands there: few
    targets hang in the air.
    """
    ways = _open_ways(sampled, distance, _SIDES)
    target = sampled.target
    observations = sampled.observations(target.center + target.diameter / 2 * ways)
    square = np.einsum("vpd,pd->vp", observations.direction, ways) >= math.cos(math.radians(SQUARE))
    count = (square & (observations.weight > 0)).sum(axis=0)
    nearest = (ways @ sampled.directions().T).max(axis=1)
    worst = int(np.argmin(nearest))
    return Sides(
        shut=1 - len(ways) / len(_ways(sampled, _SIDES)),
        unseen=float(np.mean(count == 0)),
        seen_once=float(np.mean(count == 1)),
        gap=math.degrees(math.acos(min(1.0, float(nearest[worst])))),
        farthest=ways[worst],
    )


def _ways(sampled: ViewSet, count: int) -> Floats:
    """Directions (n, 3) evenly all round, but for those below all cameras."""
    return sides_above(sampled.up, float((sampled.directions() @ sampled.up).min()), count)


def sides_above(up: Floats, lowest: float, count: int) -> Floats:
    """Directions evenly all round, but for those below the horizon and below all cameras.

    Few targets hang in the air: what nobody looks at from below needs no view.

    Args:
        up: (3,) unit vector.
        lowest: sine of the least elevation of a camera.
        count: of all directions; those that are left out are fewer.
    """
    half = directions_for(3, count // 2)
    ways = np.concatenate([half, -half])
    return np.asarray(ways[ways @ up >= min(0.0, lowest) - 1e-9])


def _open_ways(sampled: ViewSet, distance: float, count: int) -> Floats:
    """Those of the directions from which a camera would see the target."""
    ways = _ways(sampled, count)
    if sampled.space is None:
        return ways
    target = sampled.target
    places = target.center + distance * ways
    clear = sampled.space.in_sight(places, target.center, target.diameter / 2) >= 0.5
    if not clear.any():
        raise InputError(
            "the depth of the pictures leaves no side from which the target is seen: check "
            "--center and --diameter"
        )
    return ways[clear]
