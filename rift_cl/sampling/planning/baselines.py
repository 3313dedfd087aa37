"""What people do without a plan: rings, arcs, zigzags, even and random directions.

Each keeps to the same constraints and costs no more than the plan may; each gets the camera type
and settings with which even directions do best, and the elevation or arc at which it does best.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera
from rift_cl.sampling.planning.candidates import allowed, settings_of, spread
from rift_cl.sampling.planning.design_space import AZIMUTH, ELEVATION, EXPOSURE, DesignSpace
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.paths import Free, Spline
from rift_cl.sampling.planning.simple_ways import edge_ways, quantiles_of_power
from rift_cl.sampling.planning.view_costs import paid
from rift_cl.sampling.planning.view_table import ViewTable

Floats = NDArray[np.float64]
# Elevations of rings, ends of arcs along each axis, points laid along a curve, draws of random
# views, and how many times more even directions are laid where few are allowed.
_RINGS, _ENDS, _LAID, _DRAWS, _ROUNDS = 13, 5, 720, 5, 6


class Baseline(NamedTuple):
    """An arrangement that no plan was needed for.

    Args:
        described: which of its kind it is, in words.
        cameras: the views.
        stations: the same as a planner moves them.
        merit: as of the plan; of random views the mean over draws.
        elsewhere: as of the plan.
    """

    described: str
    cameras: tuple[Camera, ...]
    view_table: ViewTable
    merit: float
    elsewhere: float


class _Lens(NamedTuple):
    """A type and its settings, and how many views of it are paid for."""

    kind: int
    row: Floats
    views: int


def baselines(objective: Objective, views: int, seed: int = 0) -> dict[str, Baseline]:
    """The best ring, arc and zigzag, even directions (Fibonacci) and random ones, by name.

    For a flat target also views at quantiles of the root of its power.

    Args:
        objective: what is to be small, and where.
        views: how many, at the most.
        seed: of the random ones.

    Returns:
        What is possible under the constraints: one that has no place, or would be no path where
        one is wanted, is left out.
    """
    design = objective.design
    lens = _best_lens(objective, views)
    if lens is None:
        return {}
    path = design.constraints.path
    found = {"ring": _best(objective, _rings(design, lens))}
    if isinstance(path, Free | Spline):
        found["arc"] = _best(objective, _arcs(design, lens))
    if isinstance(path, Free):
        even = _even(design, lens, 0)
        found["fibonacci"] = _best(objective, [("a Fibonacci sphere", even)] if even else [])
        found["zigzag"] = _best(objective, _zigzags(design, lens))
        found["quantiles"] = _best(objective, _quantiles(design, lens))
        found["random"] = _random(objective, lens, seed)
    return {name: baseline for name, baseline in found.items() if baseline is not None}


def _best_lens(objective: Objective, views: int) -> _Lens | None:
    design, found = objective.design, []
    for kind in range(len(design.types)):
        for row in settings_of(objective, kind, views):
            count = paid(design, kind, float(row[EXPOSURE]), views)
            lens = _Lens(kind, row, count)
            view_table = _even(design, lens, 0) if count else None
            if view_table is not None:
                found.append((objective.rough.value(view_table), lens))
    return min(found, key=lambda entry: entry[0])[1] if found else None


def _best(objective: Objective, options: list[tuple[str, ViewTable]]) -> Baseline | None:
    if not options:
        return None
    merits = [objective.rough.value(view_table) for _, view_table in options]
    described, view_table = options[int(np.argmin(merits))]
    values = (one.value(view_table) for one in (objective, objective.elsewhere))
    return Baseline(described, view_table.cameras(objective.design), view_table, *values)


def _stations(lens: _Lens, angles: Floats) -> ViewTable:
    table = np.repeat(lens.row[None], len(angles), axis=0)
    table[:, [AZIMUTH, ELEVATION]] = angles
    return ViewTable(np.full(len(angles), lens.kind), table)


def _along(
    design: DesignSpace,
    lens: _Lens,
    described: str,
    angles: Floats,
    *,
    ends: bool,
    closed: bool = False,
) -> list[tuple[str, ViewTable]]:
    """Views evenly along a curve, at its ends or inside; none where there is no place for them.

    Free views stand along what keep-outs leave of the curve, and its name says that it has a gap.
    Views on a path are even over the whole of it: a gap would make it another path.

    Args:
        design: where views may stand.
        lens: of all views.
        described: the curve's name.
        angles: (n, 2) azimuth and elevation of points evenly along it.
        ends: whether the first and the last view stand at its ends.
        closed: whether it ends where it began, so that views may begin anywhere.
    """
    laid = _stations(lens, angles)
    clear = allowed(design, laid)
    free = isinstance(design.constraints.path, Free)
    kept = np.flatnonzero(clear) if free else np.arange(len(clear))
    if not len(kept):
        return []
    share = np.linspace(0, 1, lens.views) if ends else (np.arange(lens.views) + 0.5) / lens.views
    places = kept[np.minimum((share * len(kept)).astype(int), len(kept) - 1)]
    name = described if len(kept) == len(clear) else f"{described} with a gap"
    for begin in range(math.ceil(len(clear) / lens.views) if closed and not free else 1):
        stands = (places + begin) % len(clear)
        if clear[stands].all():
            return [(name, laid.take(stands))]
    return []


def _rings(design: DesignSpace, lens: _Lens) -> list[tuple[str, ViewTable]]:
    (first, last), closed = design.constraints.azimuth, design.constraints.full_circle
    found: list[tuple[str, ViewTable]] = []
    for elevation in _levels(design.constraints.elevation, _RINGS):
        turn = np.linspace(first, last, _LAID, endpoint=not closed)
        angles = np.column_stack([turn, np.full(_LAID, elevation)])
        described = f"a ring at {math.degrees(elevation):.0f} degrees"
        found += _along(design, lens, described, angles, ends=not closed, closed=closed)
    return found


def _arcs(design: DesignSpace, lens: _Lens) -> list[tuple[str, ViewTable]]:
    """Straight paths in azimuth and elevation, of at most half a turn."""
    first, last = design.constraints.azimuth
    last = min(last, first + math.pi)
    corners = list(
        itertools.product((first, last), _levels(design.constraints.elevation, _ENDS))
    ) + list(itertools.product(((first + last) / 2,), _levels(design.constraints.elevation, 2)))
    found: list[tuple[str, ViewTable]] = []
    for start, end in itertools.combinations(corners, 2):
        if math.dist(start, end) < 1e-6:
            continue
        share = np.linspace(0, 1, _LAID)[:, None]
        angles = np.array(start) * (1 - share) + np.array(end) * share
        a, b = (tuple(round(math.degrees(x)) for x in corner) for corner in (start, end))
        described = f"an arc from azimuth, elevation {a} to {b} degrees"
        # Half a turn ends on the line where it began: there views stand half a step inside.
        for ends in (True, False):
            found += _along(design, lens, described, angles, ends=ends)
    return found


def _zigzags(design: DesignSpace, lens: _Lens) -> list[tuple[str, ViewTable]]:
    ends = not design.constraints.full_circle
    return [
        option
        for described, angles in edge_ways(design.constraints)
        for option in _along(design, lens, described, angles, ends=ends)
    ]


def _quantiles(design: DesignSpace, lens: _Lens) -> list[tuple[str, ViewTable]]:
    angles = quantiles_of_power(design.target, design.constraints, lens.views)
    if angles is None:
        return []
    view_table = _stations(lens, angles)
    if not allowed(design, view_table).all():
        return []
    return [("views by the root of the power", view_table)]


def _even(design: DesignSpace, lens: _Lens, seed: int) -> ViewTable | None:
    """As many views as wanted of those of a Fibonacci lattice that are allowed."""
    laid = lens.views
    for _ in range(_ROUNDS):
        view_table = _stations(lens, spread(design.constraints, laid, seed))
        clear = np.flatnonzero(allowed(design, view_table))
        if len(clear) >= lens.views:
            chosen = np.linspace(0, len(clear) - 1, lens.views).round().astype(int)
            return view_table.take(clear[chosen])
        laid = math.ceil(laid * max(1.2, min(8.0, 1.05 * lens.views / max(len(clear), 1))))
    return None


def _random(objective: Objective, lens: _Lens, seed: int) -> Baseline | None:
    design, random = objective.design, np.random.default_rng(seed)
    (first, last), (low, high) = design.constraints.azimuth, design.constraints.elevation
    draws = []
    for _ in range(_DRAWS):
        tries = lens.views * 40
        height = random.uniform(math.sin(low), math.sin(high), tries)
        elevation = np.clip(np.arcsin(np.clip(height, -1, 1)), low, high)
        laid = _stations(lens, np.column_stack([random.uniform(first, last, tries), elevation]))
        clear = np.flatnonzero(allowed(design, laid))[: lens.views]
        if len(clear) == lens.views:
            draws.append(laid.take(clear))
    if not draws:
        return None
    merits = [
        float(np.mean([one.value(view_table) for view_table in draws]))
        for one in (objective, objective.elsewhere)
    ]
    return Baseline("random directions", draws[0].cameras(design), draws[0], *merits)


def _levels(limits: tuple[float, float], count: int) -> list[float]:
    low, high = limits
    return [low] if high - low < 1e-9 else np.linspace(low, high, count).tolist()
