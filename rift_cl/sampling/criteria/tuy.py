"""Tuy's condition: does every plane through the target meet the cameras' path?

It is what rays from points need for an exact reconstruction (Tuy 1983; Smith 1985). One ring of
cameras does not do; two at right angles do, for a target that is small enough. Cameras are points
and not a path, so that a plane counts as met where one stands near it. The source of a scanner
does move along a path, and a plane with views on either side of it is one that it crossed: for
scans the share of planes that were never crossed is given for every point.
"""

from __future__ import annotations

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
# Planes through a point of which it is counted how many were crossed.
_CROSSED = 1 << 14


@dataclass(frozen=True, eq=False)
class Tuy:
    """Which planes through the target no camera lies near.

    Args:
        unmet: the share of them.
        normal: (3,) of the plane that is furthest from all cameras.
        offset: of that plane from the target's middle.
        distance: of that plane from the nearest camera.
        tolerance: up to which a plane counts as met.
    """

    unmet: float
    normal: Floats
    offset: float
    distance: float
    tolerance: float

    @property
    def satisfied(self) -> bool:
        """Whether every plane that was tried is met."""
        return self.unmet == 0

    @property
    def sentence(self) -> str:
        """The finding for a reader."""
        if self.satisfied:
            return f"Every plane through the target has a camera within {self.tolerance:.3g}."
        x, y, z = self.normal + 0.0
        return (
            f"{self.unmet:.1%} of the planes through the target have no camera within "
            f"{self.tolerance:.3g}; the loneliest, across ({x:.2f}, {y:.2f}, {z:.2f}), is "
            f"{self.distance:.3g} away from all."
        )


def tuy(cameras: Sequence[Camera], target: Target, *, tolerance: float | None = None) -> Tuy:
    """Tuy's condition: every plane through the target's ball has a camera near it.

    Args:
        cameras: the views; only where they stand counts.
        target: its middle and diameter.
        tolerance: how near; the median distance from a camera to its nearest neighbour by default,
            but a hundredth of the diameter at least.

    Raises:
        InputError: there is no camera, or the tolerance is not positive.
    """
    if not len(cameras):
        raise InputError("cameras is empty, wanted at least one view")
    places = np.stack([camera.center for camera in cameras]) - target.center
    near = _spacing(places, target.diameter) if tolerance is None else one_number(tolerance)
    if not near > 0:
        raise InputError(f"tolerance is {tolerance!r}, wanted a positive length")
    # A flat path is blind along its own normal, which no even set of directions hits.
    spread = places - places.mean(0)
    own = np.linalg.eigh(spread.T @ spread)[1].T
    normals = np.concatenate([half_sphere(_NORMALS), own])
    offsets = np.linspace(-0.5, 0.5, _OFFSETS) * target.diameter
    distances = np.empty((len(normals), _OFFSETS))
    for part in runs(len(normals), _OFFSETS * len(places)):
        heights = normals[part] @ places.T
        distances[part] = np.abs(heights[:, None] - offsets[:, None]).min(2)
    worst = np.unravel_index(int(np.argmax(distances)), distances.shape)
    unmet = float((distances > near).mean())
    offset = float(offsets[worst[1]])
    return Tuy(unmet, normals[worst[0]], offset, float(distances[worst]), near)


def _spacing(places: Floats, diameter: float) -> float:
    """Median distance between neighbouring cameras."""
    from scipy.spatial import cKDTree

    least = 0.01 * diameter
    if len(places) < 2:
        return least
    nearest: Floats = cKDTree(places).query(places, k=2)[0][:, 1]
    return max(least, float(np.median(nearest)))


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
