"""Regions without cameras, and bodies that occlude the target.

A shape answers how far points lie outside it (negative inside) and in which direction that grows,
so that refinement can move along its surface instead of only rejecting what is inside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, checked_flag
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.sampling.planning.out_of_sight import OutOfSight

Floats = NDArray[np.float64]
# Halvings by the golden section of a line of sight: to a hundred-millionth of its length.
_SECTIONS = 40


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Args:
        center: (3,) in world coordinates.
        radius: in the unit of the world.

    Raises:
        InputError: the centre is no point, or the radius is not positive.
    """

    center: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, "center", _point("Sphere: center", self.center))
        if not one_number(self.radius) > 0:
            raise InputError(f"Sphere: radius is {self.radius!r}, wanted a positive length")

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distance of points (n, 3) from the surface, (n,), and its gradient, (n, 3)."""
        away = points - self.center
        length = np.linalg.norm(away, axis=-1)
        return length - self.radius, away / np.maximum(length, 1e-300)[..., None]


@dataclass(frozen=True)
class Box:
    """A box along the axes of the world.

    Args:
        low: (3,) corner with the smallest coordinates.
        high: (3,) corner with the largest; infinite ones make a half-space, such as a floor.

    Raises:
        InputError: a corner is no point, or the box is empty.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check the corners."""
        for name in ("low", "high"):
            object.__setattr__(self, name, _point(f"Box: {name}", getattr(self, name), True))
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise InputError(f"Box: from {self.low} to {self.high} is empty, wanted low below high")

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distance of points (n, 3) from the surface, (n,), and its gradient, (n, 3)."""
        below, above = np.asarray(self.low) - points, points - np.asarray(self.high)
        excess = np.maximum(below, above)
        sign = np.where(above >= below, 1.0, -1.0)
        outside = np.maximum(excess, 0)
        length = np.linalg.norm(outside, axis=-1)
        nearest = np.eye(3)[np.argmax(excess, axis=-1)]
        inside = np.max(excess, axis=-1) <= 0
        slope = np.where(
            inside[..., None], nearest, outside / np.maximum(length, 1e-300)[..., None]
        )
        return np.where(inside, np.max(excess, axis=-1), length), slope * sign


@dataclass(frozen=True)
class Cone:
    """An endless round cone.

    Args:
        apex: (3,) its tip, in world coordinates.
        axis: (3,) where it opens to, of any length.
        half_angle: between axis and surface in radians, below a right angle.

    Raises:
        InputError: a vector is none, the axis is zero, or the angle is out of range.
    """

    apex: tuple[float, float, float]
    axis: tuple[float, float, float]
    half_angle: float

    def __post_init__(self) -> None:
        """Check the numbers and bring the axis to length 1."""
        object.__setattr__(self, "apex", _point("Cone: apex", self.apex))
        axis = np.array(_point("Cone: axis", self.axis))
        if not axis.any():
            raise InputError("Cone: axis is zero, wanted a direction")
        object.__setattr__(self, "axis", tuple((axis / np.linalg.norm(axis)).tolist()))
        if not 0 < one_number(self.half_angle) < math.pi / 2:
            raise InputError(
                f"Cone: half_angle is {self.half_angle!r}, wanted radians between 0 and pi / 2"
            )

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distance of points (n, 3) from the surface, (n,), and its gradient, (n, 3)."""
        axis = np.asarray(self.axis)
        sine, cosine = math.sin(self.half_angle), math.cos(self.half_angle)
        away = points - self.apex
        along = away @ axis
        across = away - along[..., None] * axis
        radius, length = np.linalg.norm(across, axis=-1), np.linalg.norm(away, axis=-1)
        at_tip = along * cosine + radius * sine <= 0
        mantle = cosine * across / np.maximum(radius, 1e-300)[..., None] - sine * axis
        tip = away / np.maximum(length, 1e-300)[..., None]
        distance = np.where(at_tip, length, radius * cosine - along * sine)
        return distance, np.where(at_tip[..., None], tip, mantle)


@dataclass(frozen=True)
class KeepOut:
    """A place that cameras stay out of.

    Args:
        shape: where.
        hides: whether it is a body: the target is not seen through it either.

    Raises:
        InputError: the shape is none of these, or hides though it is no body.
    """

    shape: Sphere | Box | Cone | OutOfSight
    hides: bool = False

    def __post_init__(self) -> None:
        """Check the kind of the shape."""
        checked_flag("KeepOut", "hides", self.hides)
        if isinstance(self.shape, OutOfSight) and self.hides:
            raise InputError("KeepOut: OutOfSight has no surface that could hide a target")
        if not isinstance(self.shape, Sphere | Box | Cone | OutOfSight):
            raise InputError(f"KeepOut: shape is {self.shape!r}, wanted a Sphere, a Box or a Cone")

    def clearance(
        self, places: Floats, center: Floats, radius: float = 0.0
    ) -> tuple[Floats, Floats]:
        """How far cameras, or their lines of sight, stay clear.

        Args:
            places: (n, 3) where the cameras stand.
            center: (3,) what they look at.
            radius: of the ball about it that a body is to leave in sight; of a body that reaches
                into the ball, as much of it as it leaves free.

        Returns:
            Distances (n,), negative where a camera may not stand, and their gradient by the
            places, (n, 3).
        """
        if not self.hides:
            return self.shape.distance(places)
        # The shapes are convex, so that along a line of sight the distance has one minimum, also
        # less the radius there of the cone from the camera to the ball.
        free = float(self.shape.distance(np.asarray(center)[None])[0][0])
        radius = min(radius, max(free, 0.0))
        step = center - places
        low, high = np.zeros(len(places)), np.ones(len(places))
        share = (math.sqrt(5) - 1) / 2
        for _ in range(_SECTIONS):
            first, second = high - share * (high - low), low + share * (high - low)
            falls = self._along(places, step, first, radius) > self._along(
                places, step, second, radius
            )
            low, high = np.where(falls, first, low), np.where(falls, high, second)
        at = (low + high) / 2
        # The ends are no stationary points: there the section only comes near.
        ends = np.stack([at, np.zeros_like(at), np.ones_like(at)])
        at = ends[
            np.argmin([self._along(places, step, end, radius) for end in ends], axis=0),
            np.arange(len(at)),
        ]
        distance, slope = self.shape.distance(places + at[:, None] * step)
        return distance - radius * at, slope * (1 - at)[:, None]

    def _along(self, places: Floats, step: Floats, share: Floats, radius: float) -> Floats:
        return self.shape.distance(places + share[:, None] * step)[0] - radius * share


def _point(name: str, value: ArrayLike, endless: bool = False) -> tuple[float, float, float]:
    numbers = real_numbers(value)
    fine = numbers is not None and numbers.shape == (3,) and not np.isnan(numbers).any()
    if not fine or numbers is None or not (endless or np.isfinite(numbers).all()):
        raise InputError(f"{name} is {value!r}, wanted three real numbers")
    x, y, z = numbers.tolist()
    return x, y, z
