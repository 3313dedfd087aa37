"""Tuy's condition: does every plane through the target meet the cameras' path?

It is what rays from points need for an exact reconstruction (Tuy 1983; Smith 1985). One ring of
cameras does not do, however many they are; two at right angles do, for a target that is small
enough. Cameras are points, so that a path is laid through them: from each to its neighbours, where
these are not too far apart as the target sees them. Of a scanner, whose source does move along a
path, the share of planes that it never crossed is given for every point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera, Cone, Vectors
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.sampling.coverage.density import half_sphere
from rift_cl.sampling.criteria.orlov import runs
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Planes through the target: directions, and places along each.
_NORMALS, _OFFSETS = 1024, 9
# Smallest share that is printed.
_LEAST = 1e-3
# Planes through a point of which it is counted how many were crossed.
_CROSSED = 1 << 14
# Distance up to which a plane counts as met, as a share of the target's diameter.
_NEAR = 0.01
# Cosine of the angle between cameras that are too far apart for a path from one to the other, and
# how many neighbours of each it may lead to.
_APART, _NEIGHBOURS = math.sqrt(0.5), 8


@dataclass(frozen=True, eq=False)
class Tuy:
    """Which planes through the target do not meet the path through the cameras.

    Args:
        unmet: the share of them, over all normals and all places along the diameter, to some 1e-3.
        normal: (3,) of the plane that is furthest from the path.
        offset: of that plane from the target's middle.
        distance: of that plane from the path.
        tolerance: distance up to which a plane counts as met.
    """

    unmet: float
    normal: Floats
    offset: float
    distance: float
    tolerance: float

    @property
    def satisfied(self) -> bool:
        """Whether every plane that was tried is met.

        The plane of a ring is tried although it counts for nothing in the share of all planes.
        """
        return self.distance <= self.tolerance

    @property
    def unmet_in_words(self) -> str:
        """The share in per cent; one that would round to nothing is not printed as nothing."""
        return f"{self.unmet:.1%}" if self.unmet >= _LEAST else f"under {_LEAST:.1%}"

    @property
    def sentence(self) -> str:
        """The finding for a reader."""
        if self.satisfied:
            return "Every plane through the target meets the path through neighbouring cameras."
        x, y, z = self.normal + 0.0
        return (
            f"{self.unmet_in_words} of the planes through the target do not meet the path through "
            f"neighbouring cameras; the loneliest, across ({x:.2f}, {y:.2f}, {z:.2f}), is "
            f"{self.distance:.3g} away from it."
        )


def tuy(cameras: Sequence[Camera], target: Target, *, tolerance: float | None = None) -> Tuy:
    """Tuy's condition: every plane through the target's ball meets the cameras' path.

    The path goes from camera to camera by the shortest ways that connect them, and not between
    cameras that the middle of the target sees more than 45 degrees apart.

    Args:
        cameras: the views; only where they stand counts.
        target: its middle and diameter.
        tolerance: distance from the path up to which a plane counts as met; a hundredth of the
            diameter by default.

    Raises:
        InputError: there is no camera, or the tolerance is not positive.
    """
    if not len(cameras):
        raise InputError("cameras is empty, wanted at least one view")
    places = np.stack([camera.center for camera in cameras]) - target.center
    near = _NEAR * target.diameter if tolerance is None else one_number(tolerance)
    if not near > 0:
        raise InputError(f"tolerance is {tolerance!r}, wanted a positive length")
    # A flat path is blind along its own normal, which no even set of directions hits. It may be
    # the loneliest, but stands for no share of all directions.
    spread = places - places.mean(0)
    own = np.linalg.eigh(spread.T @ spread)[1].T
    normals = np.concatenate([half_sphere(_NORMALS), own])
    offsets = np.linspace(-0.5, 0.5, _OFFSETS) * target.diameter
    begin, end = _path(places, near)
    distances = np.empty((len(normals), _OFFSETS))
    for part in runs(len(normals), _OFFSETS * len(begin)):
        first, last = normals[part] @ begin.T, normals[part] @ end.T
        low, high = np.minimum(first, last)[:, None], np.maximum(first, last)[:, None]
        beyond = np.maximum(low - offsets[:, None], offsets[:, None] - high)
        distances[part] = np.maximum(beyond, 0).min(2)
    worst = np.unravel_index(int(np.argmax(distances)), distances.shape)
    # The planes that touch the ball, where a path is furthest, stand for half a step each.
    share = np.ones(_OFFSETS)
    share[[0, -1]] = 0.5
    unmet = float(np.average((distances[:_NORMALS] > near).mean(0), weights=share))
    offset = float(offsets[worst[1]])
    return Tuy(unmet, normals[worst[0]], offset, float(distances[worst]), near)


def _path(places: Floats, near: float) -> tuple[Floats, Floats]:
    """Both ends (E, 3) of each piece of a path through all places; of lone ones, twice the place.

    Args:
        places: (V, 3), from the middle of the target.
        near: places within about this of each other are one.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree
    from scipy.spatial import cKDTree

    _, kept = np.unique(np.round(places / near), axis=0, return_index=True)
    places = places[np.sort(kept)]
    count = len(places)
    if count < 2:
        return places, places
    away, other = cKDTree(places).query(places, k=min(_NEIGHBOURS + 1, count))
    near_ones = np.repeat(np.arange(count), other.shape[1] - 1), other[:, 1:].ravel()
    tree = minimum_spanning_tree(
        coo_array((away[:, 1:].ravel(), near_ones), (count, count)).tocsr()
    ).tocoo()
    # The tree of a closed path leaves a gap, which the two nearest of every place close.
    pairs = np.concatenate(
        [np.stack([tree.row, tree.col], 1), *(other[:, [0, k]] for k in (1, 2) if k < count)]
    )
    begin, end = places[pairs[:, 0]], places[pairs[:, 1]]
    apart = (begin * end).sum(1)
    lengths = np.linalg.norm(begin, axis=1) * np.linalg.norm(end, axis=1)
    joined = apart >= _APART * lengths
    return np.concatenate([begin[joined], places]), np.concatenate([end[joined], places])


def missed_planes(scan: Cone | Vectors, points: ArrayLike) -> Floats:
    """For each point the share of the planes through it that the source never crossed.

    What varies across such a plane is not measured there: the plane's integral, or its derivative,
    enters no projection. On the axis of a circle of radius R, at height z, it is the planes
    within ``atan(z / R)`` of the orbit's, ``1 - R / sqrt(R^2 + z^2)`` of all.

    Args:
        scan: its views are taken for places on one connected path of the source. What the detector
            does not see of a point is not counted.
        points: (P, 3) as (x, y, z), in the grid's coordinates.

    Returns:
        (P,) shares, 0 where Tuy's condition is met, to about 1e-4.

    Raises:
        ShapeError: points have another shape.
        InputError: they are no finite numbers.
    """
    places = real_numbers(points)
    if places is None or not np.isfinite(places).all():
        raise InputError("points are no finite numbers, wanted (P, 3) of them, (x, y, z)")
    if places.ndim != 2 or places.shape[1] != 3:
        raise ShapeError(f"points has shape {places.shape}, wanted (P, 3)")
    normals = half_sphere(_CROSSED)
    low, high = np.empty((2, len(normals)))
    for part in runs(len(normals), len(scan.source)):
        heights = normals[part] @ scan.source.T
        low[part], high[part] = heights.min(axis=1), heights.max(axis=1)
    shares = np.empty(len(places))
    for part in runs(len(places), len(normals)):
        across = places[part] @ normals.T
        shares[part] = ((across < low) | (across > high)).mean(axis=1)
    return shares
