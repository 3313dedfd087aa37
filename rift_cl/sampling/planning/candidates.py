"""The views among which a planner first chooses, spread over the allowed part of the sphere.

Each direction comes with every camera type and, where a type can be set, a few settings of it.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.design_space import (
    AZIMUTH,
    COLUMNS,
    DISTANCE,
    ELEVATION,
    EXPOSURE,
    F_NUMBER,
    FOCAL,
    FOCUS,
    DesignSpace,
)
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.view_costs import affordable
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Directions, at least and for each view; and candidates of all types and settings.
_DIRECTIONS, _PER_VIEW, _CANDIDATES = 480, 6, 2400
# Settings of a type; where there are more, those that do best all round.
_SETTINGS, _TRIAL = 8, 12
_GOLDEN = (math.sqrt(5) - 1) / 2
# How often more directions are laid where keep-outs leave few.
_ROUNDS = 5
# Directions that a surface will be looked at from, as far as it is not told.
_LOOKED_FROM = 200


def candidates(objective: Objective, views: int, seed: int) -> ViewTable:
    """Views to choose from.

    Args:
        objective: what is to be small, and where.
        views: how many will be chosen.
        seed: turns the directions.

    Raises:
        InputError: keep-outs leave no place to stand.
    """
    design = objective.design
    settings = [settings_of(objective, kind, views) for kind in range(len(design.types))]
    per_direction = sum(len(rows) for rows in settings)
    least = max(_DIRECTIONS, _PER_VIEW * views)
    wanted = max(min(least, _CANDIDATES // per_direction), 2 * views)
    laid = wanted
    for attempt in itertools.count():
        angles = spread(design.constraints, laid, seed)
        parts = [_at(angles, kind, rows) for kind, rows in enumerate(settings)]
        view_table = ViewTable.joined(parts)
        open_places = allowed(design, view_table)
        if open_places.sum() >= wanted * per_direction // 2 or attempt == _ROUNDS:
            break
        laid *= 3 if attempt < 2 else 2
    if not open_places.any():
        raise InputError(_nowhere(design, view_table))
    found = view_table.take(open_places)
    # More were laid than wanted where much is kept out; every n-th is spread as evenly.
    return found.take(np.arange(0, len(found), max(1, len(found) // (2 * wanted * per_direction))))


def most_candidates(views: int) -> int:
    """Largest number of candidates for a number of views of one camera type."""
    return max(_CANDIDATES, 2 * views)


def spread(constraints: Constraints, count: int, seed: int) -> Floats:
    """Azimuth and elevation (count, 2) of directions spread evenly over what is allowed."""
    (first, last), (low, high) = constraints.azimuth, constraints.elevation
    shift = float(np.random.default_rng(seed).uniform())
    i = np.arange(count)
    if high - low < 1e-9:
        # An odd number of steps, so that no two lie opposite each other and see the same.
        turn = (i + shift) / (count | 1)
    elif last - first < 1e-9:
        return np.column_stack([np.full(count, first), np.linspace(low, high, count)])
    else:
        turn = np.mod(i * _GOLDEN + shift, 1)
    height = math.sin(low) + (i + 0.5) / count * (math.sin(high) - math.sin(low))
    elevation = np.clip(np.arcsin(np.clip(height, -1, 1)), low, high)
    return np.column_stack([first + turn * (last - first), elevation])


def looked_at(target: Target, constraints: Constraints) -> Target:
    """A surface that says from where it will be looked at: if it does not, where cameras may stand.

    Whoever places no camera above a target does not care about what it looks like from there.
    """
    if target.mode == "volume" or target.seen_from is not None:
        return target
    frames = constraints.frames(spread(constraints, _LOOKED_FROM, 0))
    return replace(target, seen_from=frames[:, 0])


def allowed(design: DesignSpace, view_table: ViewTable) -> NDArray[np.bool_]:
    """(V,) which of them keep clear of every keep-out."""
    places = view_table.places(design)
    clear = np.ones(len(places), bool)
    for keepout in design.constraints.keepouts:
        clear &= design.clearance(keepout, places)[0] >= 0
    return clear


def _nowhere(design: DesignSpace, view_table: ViewTable) -> str:
    places = view_table.places(design)
    shares = []
    for index, keepout in enumerate(design.constraints.keepouts):
        lost = float(np.mean(design.clearance(keepout, places)[0] < 0))
        shares.append(f"keepouts[{index}] takes {lost:.0%}")
    return (
        f"Constraints: keep-outs leave no place for a camera ({', '.join(shares)} of "
        f"{len(places)} tried): move or shrink them, or allow other elevations, azimuths or "
        "distances"
    )


def _at(angles: Floats, kind: int, rows: Floats) -> ViewTable:
    table = np.repeat(rows[None], len(angles), axis=0)
    table[:, :, [AZIMUTH, ELEVATION]] = angles[:, None]
    return ViewTable(np.full(table[..., 0].size, kind), table.reshape(-1, COLUMNS))


def settings_of(objective: Objective, kind: int, views: int) -> Floats:
    """A few rows of settings of one type; their azimuths and elevations do not count."""
    design = objective.design
    limits = design.limits[kind]
    exposure = affordable(design, kind, views)
    rows = []
    for distance, share, stop, focus in itertools.product(
        _levels(limits[DISTANCE]), (0.0, 0.5, 1.0), _levels(limits[F_NUMBER]), _even(limits[FOCUS])
    ):
        longest, _, _ = design.longest(kind, np.array(distance), np.array(focus))
        low, high = limits[FOCAL, 0], min(limits[FOCAL, 1], float(longest))
        if share > 0 and high <= low * 1.02:
            continue
        row = np.zeros(COLUMNS)
        row[[DISTANCE, F_NUMBER, FOCUS, EXPOSURE]] = distance, stop, focus, exposure
        row[FOCAL] = low + share * max(high - low, 0)
        rows.append(row)
    return _best(objective, kind, np.array(rows))


def _best(objective: Objective, kind: int, rows: Floats) -> Floats:
    """Those settings that serve best when every view has them."""
    if len(rows) <= _SETTINGS:
        return rows
    angles = spread(objective.design.constraints, _TRIAL, 0)
    values = [objective.value(_at(angles, kind, row[None])) for row in rows]
    return rows[np.sort(np.argsort(values, kind="stable")[:_SETTINGS])]


def _levels(limits: Floats) -> list[float]:
    low, high = limits.tolist()
    return [low] if high <= low * 1.02 else [low, math.sqrt(low * high), high]


def _even(limits: Floats) -> list[float]:
    low, high = limits.tolist()
    return [low] if high <= low else [low, (low + high) / 2, high]
