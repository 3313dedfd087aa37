"""Orlov's condition: does every frequency lie on the slice of some view, and if not, where?

For parallel rays views suffice if every great circle meets their directions (Orlov 1975). For a
target of diameter D slices are 1 / D thick, and the condition becomes a share: how many directions
of frequency lie on no slice, and where is the middle of the largest hole? For a ring at an
elevation e that is a cone of half-angle e about its axis, 1 - cos(e) of the sphere, less half the
thickness of a slice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.sampling.coverage.density import half_circle, half_sphere
from rift_cl.sampling.coverage.work import Views, looks_at
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Directions of frequency that are looked at, in space and in the plane.
_IN_SPACE, _IN_PLANE = 4096, 2048
# Rounds in which the largest hole is looked for more closely, and places tried in each.
_ROUNDS, _TRIES = 6, 64
# Numbers that are held at a time.
_BLOCK = 1 << 19


@dataclass(frozen=True, eq=False)
class Orlov:
    """Which directions of frequency no view samples.

    Args:
        missing: the share of them, at ``frequency``.
        axis: (3,) unit vector to the middle of the largest hole.
        angle: from there to the nearest slice, in radians.
        frequency: at which slices are 1 / diameter thick.
        satisfied: whether there is no hole.
    """

    missing: float
    axis: Floats
    angle: float
    frequency: float
    satisfied: bool

    @property
    def sentence(self) -> str:
        """The finding for a reader."""
        if self.satisfied:
            return f"At {self.frequency:.3g} cycles per unit every direction lies on some slice."
        x, y, z = self.axis + 0.0
        return (
            f"At {self.frequency:.3g} cycles per unit {self.missing:.1%} of all directions lie on "
            f"no slice; the largest hole reaches {math.degrees(self.angle):.3g} degrees about "
            f"({x:.2f}, {y:.2f}, {z:.2f})."
        )


def orlov(views: Views, target: Target, *, frequency: float | None = None, point: int = 0) -> Orlov:
    """Orlov's condition for slices of the target's thickness; arguments as ``sufficiency``."""
    wanted = wanted_frequency(frequency, target)
    observed = observed_directions(views, target, point)
    units = frequency_directions(target)
    thickness = 0.5 / (target.diameter * wanted)
    gaps = slice_gaps(observed, units)
    axis, gap = _largest_hole(
        observed, units[int(np.argmax(gaps))], float(gaps.max()), target.is_flat
    )
    missing = float((gaps > thickness).mean())
    return Orlov(missing, axis, math.asin(min(gap, 1.0)), wanted, gap <= thickness)


def slice_gaps(directions: Floats, units: Floats) -> Floats:
    """From directions of frequency (m, 3) to the nearest slice of views (V, 3): (m,) sines."""
    gaps = np.empty(len(units))
    for part in runs(len(units), len(directions)):
        gaps[part] = np.abs(units[part] @ directions.T).min(1)
    return gaps


def _largest_hole(observed: Floats, axis: Floats, gap: float, flat: bool) -> tuple[Floats, float]:
    """Climb from a direction to the middle of the hole that it lies in."""
    reach = 2 * math.pi / _IN_PLANE if flat else math.sqrt(8 * math.pi / _IN_SPACE)
    turn = 2 * np.pi * np.arange(_TRIES) * (math.sqrt(5) - 1) / 2
    for _ in range(_ROUNDS):
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        across /= np.linalg.norm(across)
        down = np.cross(axis, across)
        if flat:
            step: Any = np.linspace(-reach, reach, _TRIES)[:, None] * np.cross([0, 0, 1.0], axis)
        else:
            radius = reach * np.sqrt((np.arange(_TRIES) + 0.5) / _TRIES)
            step = np.outer(radius * np.cos(turn), across) + np.outer(radius * np.sin(turn), down)
        tried = axis + step
        tried /= np.linalg.norm(tried, axis=1, keepdims=True)
        gaps = slice_gaps(observed, tried)
        best = int(np.argmax(gaps))
        if gaps[best] > gap:
            axis, gap = tried[best], float(gaps[best])
        reach /= 4
    return axis, gap


def observed_directions(views: Views, target: Target, point: int) -> Floats:
    """Directions (n, 3) of the views that see a point.

    Raises:
        ShapeError: there is no view.
        InputError: there is no such point, or it lies outside every picture.
    """
    observations = looks_at(views, target)
    if point not in range(observations.points):
        raise InputError(f"point is {point!r}, the target has {observations.points}, from 0 on")
    point = int(point)
    observations.check_seen(point)
    directions: Floats = observations.direction[observations.weight[:, point] > 0, point]
    return directions


def frequency_directions(target: Target) -> Floats:
    """(n, 3) frequency directions that sample the half-sphere, or the half-circle."""
    return half_circle(_IN_PLANE) if target.is_flat else half_sphere(_IN_SPACE)


def wanted_frequency(frequency: float | None, target: Target) -> float:
    """The frequency itself, or the target's highest.

    Raises:
        InputError: it is not positive.
    """
    wanted = target.highest if frequency is None else one_number(frequency)
    if not wanted > 0:
        raise InputError(f"frequency is {frequency!r}, wanted cycles per unit of length, above 0")
    return wanted


def runs(count: int, each: int) -> list[slice]:
    """Runs of things, each of which holds so many numbers, that fit into the block."""
    run = max(1, _BLOCK // each)
    return [slice(first, first + run) for first in range(0, count, run)]
