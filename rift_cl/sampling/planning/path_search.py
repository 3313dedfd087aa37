"""The best path of a family: many starts are tried, the best few are moved."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.sampling.planning.candidates import settings_of
from rift_cl.sampling.planning.curve import Curve
from rift_cl.sampling.planning.curves import curves_of
from rift_cl.sampling.planning.design_space import (
    DISTANCE,
    EXPOSURE,
    F_NUMBER,
    FOCAL,
    FOCUS,
    DesignSpace,
)
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.path_layout import PathLayout
from rift_cl.sampling.planning.refine import permitted, refine
from rift_cl.sampling.planning.view_costs import paid
from rift_cl.sampling.planning.view_table import ViewTable

Floats = NDArray[np.float64]
# Paths that are moved after the best start of each; settings that are tried with each start.
_MOVED, _TRIED = 3, 3


def best_path(objective: Objective, views: int, *, moved: bool) -> ViewTable:
    """Views along the best path that was found; fewer than asked for where a budget ends first.

    Args:
        objective: what is to be small, and where.
        views: how many.
        moved: whether the best starts are refined.

    Raises:
        InputError: no path that was tried keeps to the constraints.
    """
    design = objective.design
    curves = curves_of(design.constraints)
    found: list[tuple[float, PathLayout]] = []
    for kind in range(len(design.types)):
        rows = settings_of(objective, kind, views)[:_TRIED]
        for layout in (
            PathLayout(
                design, curve, kind, count, np.concatenate([start, _shared(design, kind, row)])
            )
            for row in rows
            for count in [paid(design, kind, float(row[EXPOSURE]), views)]
            for curve in curves
            for start in curve.starts
            if count > 0 and _fits(design, kind, curve, start)
        ):
            view_table = layout.view_table(layout.start)
            if permitted(design, view_table):
                found.append((objective.value(view_table), layout))
    if not found:
        raise InputError(_no_path(design, curves, views))
    found.sort(key=lambda entry: entry[0])
    ends = [layout.view_table(layout.start) for _, layout in found[:1]]
    if moved:
        ends += [refine(objective, layout) for layout in _best_of_each(found)]
    return min(ends, key=objective.value)


def _best_of_each(found: list[tuple[float, PathLayout]]) -> list[PathLayout]:
    """The best few starts, one of each family of curves before a second of any; best first."""
    ranked = [layout for _, layout in found]
    first = {id(layout.curve): layout for layout in reversed(ranked)}
    leaders = [layout for layout in ranked if first[id(layout.curve)] is layout]
    others = [layout for layout in ranked if first[id(layout.curve)] is not layout]
    return [*leaders, *others][:_MOVED]


def _fits(design: DesignSpace, kind: int, curve: Curve, start: Floats) -> bool:
    """Whether a start differs from others where distance cannot be chosen."""
    fixed = np.ptp(design.limits[kind, DISTANCE]) <= 0.02 * design.limits[kind, DISTANCE, 0]
    return not (fixed and start[-1] > 0)


def _shared(design: DesignSpace, kind: int, row: Floats) -> Floats:
    """A row's focal length, f-number, focus and exposure as shares of their ranges."""
    limits = design.limits[kind]
    longest, _, _ = design.longest(kind, limits[DISTANCE, 0], limits[FOCUS, 0])
    room = max(min(limits[FOCAL, 1], float(longest)) - limits[FOCAL, 0], 0)
    zoom = (row[FOCAL] - limits[FOCAL, 0]) / room if room > 0 else 0.0
    low, high = limits[F_NUMBER]
    stop = math.log(row[F_NUMBER] / low) / math.log(high / low) if high > low else 0.0
    rest = [
        (row[column] - limits[column, 0]) / max(float(np.ptp(limits[column])), 1e-300)
        for column in (FOCUS, EXPOSURE)
    ]
    return np.asarray(np.clip([zoom, stop, *rest], 0, 1))


def _no_path(design: DesignSpace, curves: list[Curve], views: int) -> str:
    """Why no start will do."""
    name = type(design.constraints.path).__name__
    tried, lost = 0, np.zeros(len(design.constraints.keepouts), int)
    for curve in curves:
        for start in curve.starts:
            shared = np.zeros(4)
            layout = PathLayout(design, curve, 0, views, np.concatenate([start, shared]))
            view_table = layout.view_table(layout.start)
            tried += 1
            places = view_table.places(design)
            for index, keepout in enumerate(design.constraints.keepouts):
                lost[index] += (design.clearance(keepout, places)[0] < 0).any()
    shares = ", ".join(f"keepouts[{i}] cuts {n}" for i, n in enumerate(lost.tolist()))
    return (
        f"Constraints: no path {name} with {views} views keeps clear of the keep-outs (of {tried} "
        f"tried {shares}): take the path Free, or Spline, or allow other elevations"
    )
