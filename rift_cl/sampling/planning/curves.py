"""Where the views of a path stand, as a function of a few numbers from 0 to 1.

Each curve gives azimuth, elevation and the share of the way from the nearest to the farthest
distance, (V, 3), for a vector of numbers; and several vectors from which a search may begin.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.paths import Ring, Spline, TiltedRings

Floats = NDArray[np.float64]
_QUARTER = math.pi / 2
# Elevations of rings that are tried, points laid along a spline for each control point.
_RINGS, _LAID = 13, 24
# Turns of a spline round the target, and waves of its elevation, that are tried.
_TURNS, _WAVES = (1, 2, 3), (0, 1, 2, 3)


@dataclass(frozen=True, eq=False)
class Curve:
    """A family of paths.

    Args:
        angles: from numbers (n,) and the count of views to azimuth, elevation, share of distance.
        starts: vectors of numbers (n,) to begin from.
        low: (n,) lowest numbers.
        high: (n,) highest numbers.
    """

    angles: Callable[[Floats, int], Floats]
    starts: list[Floats]
    low: Floats
    high: Floats


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
        return [_spline(limits, path, turns) for turns in (_TURNS if limits.full_circle else (0,))]
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


def _spline(limits: Constraints, path: Spline, turns: int) -> Curve:
    """Numbers: azimuth, elevation and distance of each control point.

    Without a limit of azimuth, that of a control point is counted from an even advance.
    """
    (first, last), (low, high) = limits.azimuth, limits.elevation
    n, whole = path.controls, turns * 2 * math.pi
    advance = np.arange(n) * whole / (n if path.closed else n - 1)
    matrix, shift = _b_spline(n, path.closed, whole)

    def angles(numbers: Floats, views: int) -> Floats:
        azimuth, rise, far = numbers.reshape(3, n)
        azimuth = first + (advance + azimuth * 2 * math.pi if turns else azimuth * (last - first))
        controls = np.column_stack([azimuth, low + rise * (high - low), far])
        return _even_along(matrix @ controls + shift, views, path.closed)

    room = 0.5 if turns else 0.0
    starts = _turning_starts(path, turns) if turns else _sector_starts(path)
    return Curve(
        angles,
        [start.ravel() for start in starts],
        np.repeat([-room, 0.0, 0.0], n),
        np.repeat([room if turns else 1.0, 1.0, 1.0], n),
    )


def _turning_starts(path: Spline, turns: int) -> list[Floats]:
    n, starts = path.controls, list[Floats]()
    share = np.arange(n) / (n if path.closed else n - 1)
    rises = [np.full(n, level) for level in (0.0, 0.25, 0.5, 0.75, 1.0)]
    for waves, shift in itertools.product(_WAVES[1:], (0.0, 0.25)):
        rises.append((1 + np.sin(2 * math.pi * (waves * share + shift))) / 2)
    if not path.closed:
        rises += [share, 1 - share]
    for rise, far in itertools.product(rises, (0.0, 0.5)):
        starts.append(np.stack([np.zeros(n), rise, np.full(n, far)]))
    return starts


def _sector_starts(path: Spline) -> list[Floats]:
    n = path.controls
    share = np.arange(n) / (n if path.closed else n - 1)
    around = 2 * math.pi * share
    ways: list[tuple[Floats, Floats]] = []
    if path.closed:
        across = (1 - np.cos(around)) / 2
        ways += [(across, (1 + np.sin(m * around)) / 2) for m in (1, 2, 3)]
        ways += [((1 - np.cos(2 * around)) / 2, (1 + np.sin(around)) / 2)]
    else:
        ways += [(share, np.full(n, level)) for level in (0.0, 0.25, 0.5, 0.75, 1.0)]
        ways += [(share, (1 + np.sin(math.pi * m * (2 * share - 1))) / 2) for m in (1, 2, 3)]
        ways += [((1 - np.cos(math.pi * m * share)) / 2, share) for m in (1, 2, 3)]
    return [np.stack([*way, np.full(n, far)]) for way in ways for far in (0.0, 0.5)]


def _b_spline(n: int, closed: bool, whole: float) -> tuple[Floats, Floats]:
    """A uniform cubic B-spline: points (m, 3) are the matrix (m, n) times controls, and a shift.

    A closed one has its first point again at the end, a ``whole`` of azimuth farther.
    """
    from scipy.interpolate import BSpline

    if closed:
        places = np.linspace(0, n, n * _LAID + 1)
        basis = np.asarray(BSpline(np.arange(-3.0, n + 4), np.eye(n + 3), 3)(places))
        matrix, again = basis[:, :n].copy(), basis[:, n:]
        matrix[:, :3] += again
        shift = np.zeros((len(places), 3))
        shift[:, 0] = again.sum(1) * whole
        return matrix, shift
    inner = np.arange(n - 2.0)
    knots = np.concatenate([np.zeros(3), inner, np.full(3, inner[-1])])
    places = np.linspace(0, inner[-1], n * _LAID + 1)
    return np.asarray(BSpline(knots, np.eye(n), 3)(places)), np.zeros((len(places), 3))


def _even_along(points: Floats, views: int, closed: bool) -> Floats:
    """Points at equal steps along a polygon of azimuth, elevation, share of distance."""
    azimuth, elevation, _ = points.T
    level = np.cos(elevation)
    units = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    steps = np.linalg.norm(np.diff(units, axis=1), axis=0)
    length = np.append(0, np.cumsum(steps + 1e-12))
    share = np.arange(views) / views if closed else np.linspace(0, 1, views)
    wanted = share * length[-1]
    return np.stack([np.interp(wanted, length, column) for column in points.T], axis=1)
