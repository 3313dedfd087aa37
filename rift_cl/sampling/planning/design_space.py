"""A target and the cameras that may be placed about it: how near, how long, how far apart.

From constraints and camera types this works out the box of numbers that each type can be set to,
so that whatever a planner picks from that box has the target in its picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.sampling.planning.constraints import Constraints, Ranges
from rift_cl.sampling.planning.keep_out import KeepOut
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# What a view is set to: the columns of a table of views.
AZIMUTH, ELEVATION, DISTANCE, FOCAL, F_NUMBER, FOCUS, EXPOSURE = range(7)
COLUMNS = 7
# A camera's distance from the ball of the target, in its radius, at the least.
_NEAREST = 1.02
# Distances beyond this many diameters are not looked for.
_FARTHEST = 1e6
_HALVINGS = 80
# Diameters within these can be squared and divided by at any such distance.
_LARGEST = 1e50


@dataclass(frozen=True, eq=False)
class DesignSpace:
    """Where views are planned.

    Args:
        target: what is looked at.
        constraints: what the views have to keep to.
        types: the cameras that can be had.

    Raises:
        InputError: two types have one name, constraints name a type that is not there, or a type
            cannot have the target in its picture.
    """

    target: Target
    constraints: Constraints
    types: tuple[CameraType, ...]

    def __post_init__(self) -> None:
        """Check that every type can be used."""
        for index, kind in enumerate(self.types):
            if not isinstance(kind, CameraType):
                raise InputError(f"cameras[{index}] is {kind!r}, wanted a CameraType")
        if not 1 / _LARGEST < self.target.diameter < _LARGEST:
            raise InputError(
                f"Target: diameter is {self.target.diameter:g}, wanted a length between "
                f"{1 / _LARGEST:g} and {_LARGEST:g}: take another unit"
            )
        names = [kind.name for kind in self.types]
        if len(set(names)) < len(names):
            raise InputError(f"cameras have the names {names}: give each type a name of its own")
        unknown = sorted(set(self.constraints.ranges) - set(names))
        if unknown:
            raise InputError(
                f"Constraints: ranges names {unknown}, which is no camera's name; cameras: {names}"
            )
        _ = self.limits

    @cached_property
    def limits(self) -> Floats:
        """(types, 7, 2) lowest and highest setting of each column."""
        return np.stack([self._limits_of(kind) for kind in self.types])

    @cached_property
    def brightness(self) -> float:
        """Photons from the target of the first type as near as it may stand: what counts as 1."""
        focal, stop, exposure = (
            self.limits[0, column, 0] for column in (FOCAL, F_NUMBER, EXPOSURE)
        )
        return float(exposure * (focal / stop / self.limits[0, DISTANCE, 0]) ** 2)

    def longest(self, kind: int, distance: Floats, focus: Floats) -> tuple[Floats, Floats, Floats]:
        """The focal length at which the target just fills the picture, and its derivatives.

        Args:
            kind: which type.
            distance: from the target's centre.
            focus: of the plane in focus behind the target's centre.

        Returns:
            The focal length and its derivatives by ``distance`` and ``focus``.
        """
        magnified, radius = self.types[kind].pupil_magnification, self.target.diameter / 2
        root = np.sqrt(np.maximum(distance**2 - radius**2, 1e-300))
        image = self._half_side(kind) * root / radius
        plane = magnified * (distance + focus)
        focal = 1 / (1 / image + 1 / plane)
        by_focus = (focal / plane) ** 2 * magnified
        by_image = (focal / image) ** 2 * self._half_side(kind) / radius
        return focal, by_focus + by_image * distance / root, by_focus

    def clearance(self, keepout: KeepOut, places: Floats) -> tuple[Floats, Floats]:
        """How far cameras at places (n, 3) stay clear of a keep-out; see ``KeepOut.clearance``.

        A body is to leave as much of the target's outline in sight as a picture has to hold.
        """
        shown = math.sqrt(self.constraints.cover) * self.target.diameter / 2
        return keepout.clearance(places, self.target.center, shown)

    @cached_property
    def _half_sides(self) -> tuple[float, ...]:
        return tuple(
            _outline(kind.size, self.constraints.cover) * kind.pixel for kind in self.types
        )

    def _half_side(self, kind: int) -> float:
        """Largest radius of the target's outline on the sensor."""
        return self._half_sides[kind]

    def _limits_of(self, kind: CameraType) -> Floats:
        given, index = self.constraints.ranges.get(kind.name, Ranges()), self.types.index(kind)
        focal = given.focal_length or (kind.focal_length,) * 2
        focus = given.focus or (0.0, 0.0)
        if self.constraints.distances is None:
            distance = (self._nearest(index, focal[1], focus[0]),) * 2
        else:
            nearest, farthest = self.constraints.distances
            near = self._nearest(index, focal[0], focus[0])
            if near > farthest * (1 + 1e-9):
                raise InputError(self._too_small(kind, near, farthest))
            distance = (max(nearest, near), max(farthest, near))
        return np.array(
            [
                self.constraints.azimuth,
                self.constraints.elevation,
                distance,
                focal,
                given.f_number or (kind.f_number,) * 2,
                focus,
                given.exposure or (kind.exposure,) * 2,
            ]
        )

    def _too_small(self, kind: CameraType, near: float, far: float) -> str:
        return (
            f"Constraints: distance ends at {far:g}, but camera {kind.name!r} has "
            f"{self.constraints.cover:.0%} of the target's ball (diameter "
            f"{self.target.diameter:g}) in its picture, and can focus on it, from {near:.4g} on: "
            "allow it farther away, take a shorter lens, or ask for less cover"
        )

    def _nearest(self, kind: int, focal: float, focus: float) -> float:
        """The least distance at which a lens has the target in its picture and can focus on it."""
        magnified, diameter = self.types[kind].pupil_magnification, self.target.diameter
        low = max(_NEAREST * diameter / 2, _NEAREST * focal / magnified - focus)
        high = max(low, diameter) * _FARTHEST
        if self._holds(kind, low, focal, focus):
            return low
        if not self._holds(kind, high, focal, focus):
            raise InputError(
                f"camera {self.types[kind].name!r} never has {self.constraints.cover:.0%} of the "
                f"target's ball (diameter {self.target.diameter:g}) in its picture, however far "
                "away: check the units of its pixel and focal length"
            )
        for _ in range(_HALVINGS):
            middle = math.sqrt(low * high)
            if self._holds(kind, middle, focal, focus):
                high = middle
            else:
                low = middle
        return high

    def _holds(self, kind: int, distance: float, focal: float, focus: float) -> bool:
        longest, _, _ = self.longest(kind, np.array(distance), np.array(focus))
        return bool(longest >= focal)

    def type_at(self, kind: int, row: Floats) -> CameraType:
        """The camera type with the settings of one row of a view table."""
        return replace(
            self.types[kind],
            focal_length=float(row[FOCAL]),
            f_number=float(row[F_NUMBER]),
            exposure=float(row[EXPOSURE]),
        )


def default_types(target: Target) -> tuple[CameraType, ...]:
    """The camera for who names none: sharp everywhere, finer than the band of any target.

    A square picture of 1024 pixels, 40 degrees wide.
    """
    side, pixels = target.diameter / 2, 1024
    pitch = 2 * side * math.tan(math.radians(20)) / pixels
    return (CameraType("pinhole", side, 1e4, pitch, (pixels, pixels), wavelength=0),)


def _outline(size: Sequence[int], cover: float) -> float:
    """Radius in pixels of the largest disc of which the picture still holds a share."""
    height, width = size
    low, high = min(height, width) / 2, float(math.hypot(height, width)) / math.sqrt(cover)
    if cover >= 1:
        return low
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if _share(middle, width / 2, height / 2) >= cover:
            low = middle
        else:
            high = middle
    return low


def _share(radius: float, half_width: float, half_height: float) -> float:
    """The part of a disc's area that lies in a rectangle about its middle."""
    if radius >= math.hypot(half_width, half_height):
        return 4 * half_width * half_height / (math.pi * radius**2)
    outside = 0.0
    for half in (half_width, half_height):
        c = min(half / radius, 1.0)
        outside += 2 * (math.acos(c) - c * math.sqrt(1 - c * c))
    return 1 - outside / math.pi
