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
from rift_cl.sampling.planning.budget import paid
from rift_cl.sampling.planning.candidates import allowed, settings_of, spread
from rift_cl.sampling.planning.design_space import AZIMUTH, ELEVATION, EXPOSURE, Site
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.paths import Free, Spline
from rift_cl.sampling.planning.simple_ways import edge_ways, quantiles_of_power
from rift_cl.sampling.planning.view_table import Stations

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
    stations: Stations
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
    site = objective.site
    lens = _best_lens(objective, views)
    if lens is None:
        return {}
    path = site.constraints.path
    found = {"ring": _best(objective, _rings(site, lens))}
    if isinstance(path, Free | Spline):
        found["arc"] = _best(objective, _arcs(site, lens))
    if isinstance(path, Free):
        even = _even(site, lens, 0)
        found["fibonacci"] = _best(objective, [("a Fibonacci sphere", even)] if even else [])
        found["zigzag"] = _best(objective, _zigzags(site, lens))
        found["quantiles"] = _best(objective, _quantiles(site, lens))
        found["random"] = _random(objective, lens, seed)
    return {name: baseline for name, baseline in found.items() if baseline is not None}


def _best_lens(objective: Objective, views: int) -> _Lens | None:
    site, found = objective.site, []
    for kind in range(len(site.types)):
        for row in settings_of(objective, kind, views):
            count = paid(site, kind, float(row[EXPOSURE]), views)
            lens = _Lens(kind, row, count)
            stations = _even(site, lens, 0) if count else None
            if stations is not None:
                found.append((objective.rough.value(stations), lens))
    return min(found, key=lambda entry: entry[0])[1] if found else None


def _best(objective: Objective, options: list[tuple[str, Stations]]) -> Baseline | None:
    if not options:
        return None
    merits = [objective.rough.value(stations) for _, stations in options]
    described, stations = options[int(np.argmin(merits))]
    values = (one.value(stations) for one in (objective, objective.elsewhere))
    return Baseline(described, stations.cameras(objective.site), stations, *values)


def _stations(lens: _Lens, angles: Floats) -> Stations:
    table = np.repeat(lens.row[None], len(angles), axis=0)
    table[:, [AZIMUTH, ELEVATION]] = angles
    return Stations(np.full(len(angles), lens.kind), table)


def _along(site: Site, lens: _Lens, angles: Floats, ends: bool) -> Stations | None:
    """Views evenly along a curve, or along what keep-outs leave of it; at its ends or inside."""
    laid = _stations(lens, angles)
    clear = np.flatnonzero(allowed(site, laid))
    if not len(clear):
        return None
    share = np.linspace(0, 1, lens.views) if ends else (np.arange(lens.views) + 0.5) / lens.views
    places = np.minimum((share * len(clear)).astype(int), len(clear) - 1)
    return laid.take(clear[places])


def _rings(site: Site, lens: _Lens) -> list[tuple[str, Stations]]:
    first, last = site.constraints.azimuth
    found = []
    for elevation in _levels(site.constraints.elevation, _RINGS):
        turn = np.linspace(first, last, _LAID, endpoint=not site.constraints.full_circle)
        angles = np.column_stack([turn, np.full(_LAID, elevation)])
        stations = _along(site, lens, angles, not site.constraints.full_circle)
        if stations is not None:
            found.append((f"a ring at {math.degrees(elevation):.0f} degrees", stations))
    return found


def _arcs(site: Site, lens: _Lens) -> list[tuple[str, Stations]]:
    """Straight ways in azimuth and elevation, of half a turn at the most."""
    first, last = site.constraints.azimuth
    last = min(last, first + math.pi)
    corners = list(
        itertools.product((first, last), _levels(site.constraints.elevation, _ENDS))
    ) + list(itertools.product(((first + last) / 2,), _levels(site.constraints.elevation, 2)))
    found = []
    for start, end in itertools.combinations(corners, 2):
        if math.dist(start, end) < 1e-6:
            continue
        share = np.linspace(0, 1, _LAID)[:, None]
        angles = np.array(start) * (1 - share) + np.array(end) * share
        a, b = (tuple(round(math.degrees(x)) for x in corner) for corner in (start, end))
        # Half a turn ends on the line where it began: there views stand half a step inside.
        for ends in (True, False):
            stations = _along(site, lens, angles, ends)
            if stations is not None:
                found.append((f"an arc from azimuth, elevation {a} to {b} degrees", stations))
    return found


def _zigzags(site: Site, lens: _Lens) -> list[tuple[str, Stations]]:
    found = []
    for described, angles in edge_ways(site.constraints):
        stations = _along(site, lens, angles, ends=not site.constraints.full_circle)
        if stations is not None:
            found.append((described, stations))
    return found


def _quantiles(site: Site, lens: _Lens) -> list[tuple[str, Stations]]:
    angles = quantiles_of_power(site.target, site.constraints, lens.views)
    if angles is None:
        return []
    stations = _stations(lens, angles)
    if not allowed(site, stations).all():
        return []
    return [("views by the root of the power", stations)]


def _even(site: Site, lens: _Lens, seed: int) -> Stations | None:
    """As many views as wanted of those of a Fibonacci lattice that are allowed."""
    laid = lens.views
    for _ in range(_ROUNDS):
        stations = _stations(lens, spread(site.constraints, laid, seed))
        clear = np.flatnonzero(allowed(site, stations))
        if len(clear) >= lens.views:
            chosen = np.linspace(0, len(clear) - 1, lens.views).round().astype(int)
            return stations.take(clear[chosen])
        laid = math.ceil(laid * max(1.2, min(8.0, 1.05 * lens.views / max(len(clear), 1))))
    return None


def _random(objective: Objective, lens: _Lens, seed: int) -> Baseline | None:
    site, random = objective.site, np.random.default_rng(seed)
    (first, last), (low, high) = site.constraints.azimuth, site.constraints.elevation
    draws = []
    for _ in range(_DRAWS):
        tries = lens.views * 40
        height = random.uniform(math.sin(low), math.sin(high), tries)
        elevation = np.clip(np.arcsin(np.clip(height, -1, 1)), low, high)
        laid = _stations(lens, np.column_stack([random.uniform(first, last, tries), elevation]))
        clear = np.flatnonzero(allowed(site, laid))[: lens.views]
        if len(clear) == lens.views:
            draws.append(laid.take(clear))
    if not draws:
        return None
    merits = [
        float(np.mean([one.value(stations) for stations in draws]))
        for one in (objective, objective.elsewhere)
    ]
    return Baseline("random directions", draws[0].cameras(site), draws[0], *merits)


def _levels(limits: tuple[float, float], count: int) -> list[float]:
    low, high = limits
    return [low] if high - low < 1e-9 else np.linspace(low, high, count).tolist()
