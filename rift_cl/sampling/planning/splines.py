"""Smooth curves round a target, or within a sector of it, as B-splines of a few control points.

A search begins from turns round the target with waves of elevation, and from arcs and loops within
sectors: where something stands in the way, no full turn may be left.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.curve import Curve
from rift_cl.sampling.planning.paths import Spline

Floats = NDArray[np.float64]
# Points laid along a spline for each control point.
_LAID = 24
# Turns of a spline round the target, and waves of its elevation, that are tried.
_TURNS, _WAVES = (1, 2, 3), (0, 1, 2, 3)
# Sectors of a full circle that are tried: their widths and how many middles, in turns.
_WIDTHS, _MIDDLES = (0.25, 0.5, 0.85), 8
_LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)


def splines(limits: Constraints, path: Spline) -> list[Curve]:
    """The families of splines that constraints allow: turns round the target, and sectors."""
    turns = (*_TURNS, 0) if limits.full_circle else (0,)
    kinds = (True, False) if path.closed is None else (path.closed,)
    return [
        _spline(limits, path.controls, count, closed)
        for closed, count in itertools.product(kinds, turns)
    ]


def _spline(limits: Constraints, n: int, turns: int, closed: bool) -> Curve:
    """Numbers: azimuth, elevation and distance of each of n control points.

    With turns, the azimuth of a control point is counted from an even advance; without, it is a
    share of what is allowed, and may go on across the end of a full circle.
    """
    (first, last), (low, high) = limits.azimuth, limits.elevation
    whole = turns * 2 * math.pi
    advance = np.arange(n) * whole / (n if closed else n - 1)
    matrix, shift = _b_spline(n, closed, whole)

    def angles(numbers: Floats, views: int) -> Floats:
        azimuth, rise, far = numbers.reshape(3, n)
        azimuth = first + (advance + azimuth * 2 * math.pi if turns else azimuth * (last - first))
        controls = np.column_stack([azimuth, low + rise * (high - low), far])
        return _even_along(matrix @ controls + shift, views, closed)

    if turns:
        starts, room = _turning_starts(n, closed), (-0.5, 0.5)
    elif limits.full_circle:
        starts, room = _partial_starts(n, closed), (-0.5, 1.5)
    else:
        starts, room = _sector_starts(n, closed), (0.0, 1.0)
    return Curve(
        angles,
        [start.ravel() for start in starts],
        np.repeat([room[0], 0.0, 0.0], n),
        np.repeat([room[1], 1.0, 1.0], n),
    )


def _turning_starts(n: int, closed: bool) -> list[Floats]:
    starts = list[Floats]()
    share = np.arange(n) / (n if closed else n - 1)
    rises = [np.full(n, level) for level in _LEVELS]
    for waves, shift in itertools.product(_WAVES[1:], (0.0, 0.25)):
        rises.append((1 + np.sin(2 * math.pi * (waves * share + shift))) / 2)
    if not closed:
        rises += [share, 1 - share]
    for rise, far in itertools.product(rises, (0.0, 0.5)):
        starts.append(np.stack([np.zeros(n), rise, np.full(n, far)]))
    return starts


def _partial_starts(n: int, closed: bool) -> list[Floats]:
    """Those of a sector, for sectors of several widths all round a full circle."""
    starts = list[Floats]()
    middles = np.arange(_MIDDLES) / _MIDDLES
    for middle, width, start in itertools.product(middles, _WIDTHS, _sector_starts(n, closed)):
        moved = start.copy()
        moved[0] = middle + width * (start[0] - 0.5)
        starts.append(moved)
    return starts


def _sector_starts(n: int, closed: bool) -> list[Floats]:
    share = np.arange(n) / (n if closed else n - 1)
    around = 2 * math.pi * share
    ways: list[tuple[Floats, Floats]] = []
    if closed:
        across = (1 - np.cos(around)) / 2
        ways += [(across, (1 + np.sin(m * around)) / 2) for m in (1, 2, 3)]
        ways += [((1 - np.cos(2 * around)) / 2, (1 + np.sin(around)) / 2)]
        # There and back along an arc.
        ways += [(across, across), (across, 1 - across)]
    else:
        # Arcs, and waves across.
        ends = itertools.product(_LEVELS[::2], repeat=2)
        ways += [(share, a + (b - a) * share) for a, b in ends]
        ways += [(share, np.full(n, level)) for level in _LEVELS[1::2]]
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
