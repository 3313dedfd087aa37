"""How views see the points of a target: along which line, with what light, how sharply.

Everything that counts what views sample counts with these numbers, whatever the views come from:
posed cameras, a tomographic scan, or bare directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Camera, Parallel
from rift_cl.geometry.numbers import one_number, real_numbers

Floats = NDArray[np.float64]
# How far from 1 the length of a direction may be.
_UNIT = 1e-3


@dataclass(frozen=True, eq=False)
class Observations:
    """V views of P points; lengths in the unit of the world.

    Args:
        direction: (V, P, 3) unit vectors along the lines of sight, from the point to the camera.
        weight: (V, P) relative photons; 0 where the point is outside the picture or behind.
        pixel: (V, P) edge of a pixel in object space, the longer where its two differ; 0 for none.
        cutoff: (V, P) incoherent cut-off of diffraction; inf for none.
        blur: (V, P) diameter of the disc of defocus in object space.

    Raises:
        ShapeError: there is no view or no point, or the shapes differ.
        InputError: a number is NaN or out of its range.
    """

    direction: Floats
    weight: Floats
    pixel: Floats
    cutoff: Floats
    blur: Floats

    def __post_init__(self) -> None:
        """Check the numbers."""
        shape = np.shape(self.weight)
        if len(shape) != 2 or 0 in shape:
            raise ShapeError(
                f"Observations: weight has shape {shape}, wanted (views, points), none empty"
            )
        for entry in fields(self):
            given = getattr(self, entry.name)
            values = real_numbers(given)
            if values is None:
                raise InputError(f"Observations: {entry.name} is {given!r}, wanted real numbers")
            wanted = (*shape, 3) if entry.name == "direction" else shape
            if values.shape != wanted:
                raise ShapeError(
                    f"Observations: {entry.name} has shape {values.shape}, wanted {wanted}"
                )
            if entry.name != "direction" and not (values >= 0).all():
                raise InputError(f"Observations: {entry.name} holds NaN or a negative number")
            if entry.name in ("weight", "pixel", "blur") and not np.isfinite(values).all():
                raise NonFiniteError(f"Observations: {entry.name} holds infinity")
            object.__setattr__(self, entry.name, values)
        lengths = np.sqrt(np.einsum("vpd,vpd->vp", self.direction, self.direction))
        if not (np.abs(lengths - 1) < _UNIT).all():
            raise InputError("Observations: direction holds vectors that are not of length 1")
        if not (self.cutoff > 0).all():
            raise InputError(
                "Observations: cutoff holds 0, wanted positive frequencies, inf for none"
            )

    @property
    def views(self) -> int:
        """V, the number of views."""
        return int(self.weight.shape[0])

    @property
    def points(self) -> int:
        """P, the number of points."""
        return int(self.weight.shape[1])

    def check_seen(self, point: int | None = None) -> None:
        """Refuse points that no view sees, all of them or one.

        Raises:
            InputError: there is such a point.
        """
        unseen = np.flatnonzero(~(self.weight > 0).any(0))
        if point is not None:
            unseen = unseen[unseen == point]
        if len(unseen):
            more = f" and {len(unseen) - 1} more" if len(unseen) > 1 else ""
            raise InputError(
                f"point {unseen[0]}{more} of the target's {self.points} lie outside every picture "
                f"of {self.views} views: check its centre and unit of length, or aim at it"
            )

    @classmethod
    def of(
        cls, cameras: Sequence[Camera], points: ArrayLike, weights: ArrayLike | None = None
    ) -> Observations:
        """Observations of points by cameras, without occlusion.

        Args:
            cameras: the V views.
            points: (P, 3) in world coordinates.
            weights: (V,) relative photons of the views; 1 each by default.

        Raises:
            ShapeError: there is no camera or no point, or an array has another shape.
            InputError: what is given are no cameras, a number is not finite, or a weight negative.
        """
        x = _points(points)
        sights = [_sight(camera, x) for camera in _cameras(cameras)]
        observations = cls(*(np.stack(parts) for parts in zip(*sights, strict=True)))
        return observations.weighted(weights)

    def weighted(self, weights: ArrayLike | None) -> Observations:
        """A copy with the photons of each view multiplied by weights (V,); None changes nothing.

        Raises:
            ShapeError: there is another number of weights.
            InputError: one is not finite, or negative.
        """
        if weights is None:
            return self
        return replace(self, weight=self.weight * _weights(weights, self.views)[:, None])

    @classmethod
    def of_scan(
        cls, scan: Parallel, points: ArrayLike = ((0, 0, 0),), row_pitch: float | None = None
    ) -> Observations:
        """How a parallel scan about the z axis sees points.

        Args:
            scan: angles and detector.
            points: (P, 3); what lies beside the detector has weight 0.
            row_pitch: distance between the detector's rows, where there are rows; the larger of
                it and the pitch counts.

        Raises:
            ShapeError: points has another shape.
            InputError: the pitch is no length, or a coordinate not finite.
        """
        x, angles = _points(points), scan.angles[:, None]
        rows = scan.pitch if row_pitch is None else one_number(row_pitch)
        if not rows > 0:
            raise InputError(f"row_pitch is {row_pitch!r}, wanted a positive length")
        t = np.cos(angles) * x[:, 0] + np.sin(angles) * x[:, 1]
        bins = t / scan.pitch + scan.center
        observed = ((bins >= -0.5) & (bins <= scan.bins - 0.5)).astype(np.float64)
        line = np.concatenate([-np.sin(angles), np.cos(angles), np.zeros_like(angles)], axis=1)
        direction = np.broadcast_to(line[:, None], (*observed.shape, 3))
        edge = np.full(observed.shape, max(scan.pitch, rows))
        return cls(
            direction, observed, edge, np.full(observed.shape, np.inf), np.zeros(observed.shape)
        )

    @classmethod
    def along(cls, directions: ArrayLike) -> Observations:
        """Views along bare directions (V, 3) of any length but zero: one point, no optics.

        Raises:
            ShapeError: directions has another shape.
            InputError: a direction is zero or not finite.
        """
        values = _finite("directions", directions)
        if values.ndim != 2 or values.shape[1] != 3 or not len(values):
            raise ShapeError(f"directions has shape {values.shape}, wanted (views, 3)")
        lengths = np.linalg.norm(values, axis=1, keepdims=True)
        if not lengths.all():
            raise InputError(f"directions[{int(np.argmin(lengths))}] is zero, wanted a direction")
        one = np.ones((len(values), 1))
        return cls((values / lengths)[:, None], one, 0 * one, np.inf * one, 0 * one)


class ObservationsGradient(NamedTuple):
    """The gradient of a number by what ``Observations`` hold, in their shapes.

    Args:
        direction: (V, P, 3) across the line of sight: a unit vector moves only so.
        weight: (V, P), as are the rest.
        pixel: by the pixel's edge.
        cutoff: by the cut-off of diffraction.
        blur: by the diameter of the disc of defocus.
    """

    direction: Floats
    weight: Floats
    pixel: Floats
    cutoff: Floats
    blur: Floats


class _Sight(NamedTuple):
    """One camera's view of P points: ``Observations`` without the views' axis."""

    direction: Floats
    observed: Floats
    pixel: Floats
    cutoff: Floats
    blur: Floats


def _sight(camera: Camera, points: Floats) -> _Sight:
    local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    depth = local[:, 2]
    ahead = depth > 0
    if camera.model == "ortho":
        direction = np.broadcast_to(-camera.view[2, :3], points.shape)
        reach = np.ones(len(points))
        flat, ahead = local[:, :2], np.ones(len(points), bool)
    else:
        away = camera.center - points
        distance = np.linalg.norm(away, axis=1)
        if not distance.all():
            raise InputError("a camera stands at a point of the target: move one of them")
        direction, reach = away / distance[:, None], distance
        if camera.model == "pinhole":
            # Points behind keep the numbers of one ahead; they are not seen.
            reach = np.where(ahead, depth, distance)
            flat = local[:, :2] / reach[:, None]
        else:
            side = np.hypot(local[:, 0], local[:, 1])
            bend = np.arctan2(side, depth) / np.where(side > 0, side, 1)
            flat, ahead = local[:, :2] * bend[:, None], (depth > 0) | (side > 0)
    observed = ahead & _inside(camera, flat)
    cutoff, blur = np.full(len(points), np.inf), np.zeros(len(points))
    if camera.aperture is not None:
        cutoff, blur = camera.aperture.cutoff(reach), camera.aperture.blur(reach)
    return _Sight(
        direction, observed.astype(np.float64), reach / coarser_focal(camera), cutoff, blur
    )


def coarser_focal(camera: Camera) -> float:
    """Focal length in pixels along the axis of the picture that resolves less."""
    return float(min(camera.intrinsics[:2]))


def _inside(camera: Camera, flat: Floats) -> NDArray[np.bool_]:
    """Whether points at (P, 2) of the plane at depth one lie in the picture."""
    fx, fy, cx, cy = camera.intrinsics
    place = flat * [fx, fy] + [cx, cy]
    return np.asarray(((place >= 0) & (place <= [camera.width, camera.height])).all(1))


def _points(points: ArrayLike) -> Floats:
    x = _finite("points", points)
    if x.ndim != 2 or x.shape[1] != 3 or not len(x):
        raise ShapeError(f"points has shape {x.shape}, wanted (points, 3), at least one")
    return x


def _cameras(cameras: Any) -> list[Camera]:
    if not isinstance(cameras, Sequence) or not all(isinstance(c, Camera) for c in cameras):
        raise InputError(f"views: wanted cameras in a sequence, this is a {type(cameras).__name__}")
    if not cameras:
        raise ShapeError("cameras is empty, wanted at least one view")
    return list(cameras)


def _weights(weights: ArrayLike, count: int) -> Floats:
    light = _finite("weights", weights)
    if light.shape != (count,):
        raise ShapeError(f"weights has shape {light.shape}, wanted ({count},), one per view")
    if not (light >= 0).all():
        raise InputError(f"weights[{int(np.argmin(light))}] is {light.min():g}, wanted 0 or more")
    return light


def _finite(name: str, values: ArrayLike) -> Floats:
    array = real_numbers(values)
    if array is None:
        raise InputError(f"{name} is {values!r}, wanted real numbers")
    if not np.isfinite(array).all():
        raise NonFiniteError(f"{name} holds NaN or infinity, every entry must be finite")
    return array
