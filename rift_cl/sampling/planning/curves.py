"""The curves of each kind of path, and the positions of views along rings."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.curve import Curve
from rift_cl.sampling.planning.paths import Ring, Spline, TiltedRings
from rift_cl.sampling.planning.splines import splines

Floats = NDArray[np.float64]
_QUARTER = math.pi / 2
# Elevations of rings that are tried.
_RINGS = 13


def curves_of(limits: Constraints) -> list[Curve]:
    """The families of the path that constraints ask for.

    Raises:
        TypeError: they ask for none.
    """
    path = limits.path
    if isinstance(path, Ring):
        return [_ring(limits)]
    if isinstance(path, TiltedRings):
        return [_tilted(limits, path.count)]
    if isinstance(path, Spline):
        return splines(limits, path)
    raise TypeError("free views follow no curve")


def _ring(limits: Constraints) -> Curve:
    """Numbers: phase in steps between views, elevation, distance."""
    first, last = limits.azimuth
    low, high = limits.elevation

    def angles(numbers: Floats, views: int) -> Floats:
        phase, rise, far = numbers
        steps = np.arange(views)
        if limits.full_circle:
            turn = (steps + phase) / views
        else:
            turn = steps / max(views - 1, 1) if views > 1 else np.array([0.5])
        rows = np.empty((views, 3))
        rows[:] = 0, low + rise * (high - low), far
        rows[:, 0] = first + turn * (last - first)
        return rows

    phases = (0.0, 0.5) if limits.full_circle else (0.0,)
    starts = [
        np.array([phase, rise, far])
        for phase, rise, far in itertools.product(phases, np.linspace(0, 1, _RINGS), (0.0, 0.5))
    ]
    free = 1.0 if limits.full_circle else 0.0
    return Curve(angles, starts, np.array([-free, 0, 0]), np.array([1 + free, 1, 1]))


def _tilted(limits: Constraints, count: int) -> Curve:
    """Numbers of each ring: tilt, azimuth of the tilt, elevation over its plane, phase; distance.

    Where elevations are limited, a ring that is tilted more has less room for an elevation.
    """
    bottom, top = limits.elevation
    open_below, open_above = bottom <= -_QUARTER + 1e-9, top >= _QUARTER - 1e-9
    ends = 2 - open_below - open_above
    steepest = min(_QUARTER, (top - bottom) / ends) if ends else _QUARTER

    def angles(numbers: Floats, views: int) -> Floats:
        rows = []
        for index in range(count):
            tilt, node, rise, phase = numbers[4 * index : 4 * index + 4]
            tilt, node = tilt * steepest, node * 2 * math.pi
            low = -_QUARTER if open_below else bottom + tilt
            high = _QUARTER if open_above else top - tilt
            own = len(range(index, views, count))
            turn = (np.arange(own) + phase) * 2 * math.pi / max(own, 1)
            rows.append(_leaning(turn, low + rise * (high - low), tilt, node))
        found = np.concatenate(rows)
        return np.column_stack([found, np.full(views, numbers[-1])])

    starts = [np.array([*shape, far]) for far in (0.0, 0.5) for shape in _tilted_starts(count)]
    low = np.tile([0.0, -1, 0, -1], count)
    high = np.tile([1.0, 2, 1, 2], count)
    return Curve(angles, starts, np.append(low, 0), np.append(high, 1))


def _tilted_starts(count: int) -> list[list[float]]:
    """Tilts towards sides evenly round a half or a full turn; the first ring level, or not."""
    starts = []
    for tilt, rise, span, level in itertools.product(
        (0.25, 0.5, 0.75, 1.0), (0.0, 0.25, 0.5, 0.75, 1.0), (0.5, 1.0), (False, True)
    ):
        shape: list[float] = []
        for index in range(count):
            flat = level and index == 0
            shape += [0.0 if flat else tilt, span * index / count, rise, index / count]
        starts.append(shape)
    return starts


def _leaning(turn: Floats, rise: float, tilt: float, node: float) -> Floats:
    """Azimuth and elevation along a circle whose axis leans by ``tilt`` towards ``node``."""
    x, y, z = math.cos(rise) * np.cos(turn), math.cos(rise) * np.sin(turn), math.sin(rise)
    along, up = x * math.cos(tilt) + z * math.sin(tilt), z * math.cos(tilt) - x * math.sin(tilt)
    azimuth = np.arctan2(y, along) + node
    return np.column_stack([azimuth, np.arcsin(np.clip(up, -1, 1))])
