"""Refine views to a local minimum of the criterion by the method of moving asymptotes.

What is moved is a vector of numbers within a box; a ``Layout`` says which table of views they stand
for and how the table changes with them. Keep-outs and a budget of exposure are inequalities.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.candidates import allowed
from rift_cl.sampling.planning.design_space import (
    AZIMUTH,
    COLUMNS,
    DISTANCE,
    ELEVATION,
    EXPOSURE,
    DesignSpace,
)
from rift_cl.sampling.planning.keep_out import KeepOut
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.view_costs import cost, total
from rift_cl.sampling.planning.view_table import ViewTable

Floats = NDArray[np.float64]
# Evaluations of the criterion. One that falls little says nothing, since the method first finds out
# how far it may go: it ends where so many together lowered the criterion by less than a share.
STEPS = 60
_ENOUGH, _SEVERAL = 1e-3, 8
# How far a keep-out may be entered while views move, in target diameters; steps back out of it.
_TOLERANCE, _BACK = 1e-7, 40


class Layout(Protocol):
    """Views as a function of a vector of numbers, all of them about 1."""

    @property
    def start(self) -> Floats:
        """(n,) where the refinement begins."""

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lowest and highest values, (n,) each."""

    @property
    def reach(self) -> float:
        """How far a camera may move at the most."""

    def view_table(self, numbers: Floats) -> ViewTable:
        """The views at some numbers."""

    def pulled_back(self, numbers: Floats, by_table: Floats) -> Floats:
        """Derivatives by the numbers, (m, n), from those by the table, (m, V, 7)."""

    def nearer(self, numbers: Floats, views: NDArray[np.bool_]) -> Floats:
        """Numbers at which some views (V,) are closer to where they were at the start."""


def refine(objective: Objective, layout: Layout, steps: int = STEPS) -> ViewTable:
    """The best views found from a layout's start, which itself is one of them.

    Args:
        objective: what is to be small.
        layout: what can be moved; its start keeps to all constraints.
        steps: largest number of evaluations of the criterion.
    """
    import nlopt

    start = layout.start
    if not len(start):
        return layout.view_table(start)
    low, high = layout.box
    optimiser = nlopt.opt(nlopt.LD_MMA, len(start))
    optimiser.set_lower_bounds(low)
    optimiser.set_upper_bounds(high)
    optimiser.set_maxeval(steps)
    evaluated: list[tuple[float, Floats]] = []

    def criterion(numbers: Floats, slope: Floats) -> float:
        value, by_table = objective.gradient(layout.view_table(numbers))
        evaluated.append((value, numbers.copy()))
        if slope.size:
            slope[:] = layout.pulled_back(numbers, by_table[None])[0]
        if _settled([entry[0] for entry in evaluated]):
            optimiser.force_stop()
        return value

    optimiser.set_min_objective(criterion)
    _constrain(optimiser, objective.design, layout)
    # Where it breaks off, what was seen until then stands.
    with contextlib.suppress(nlopt.RoundoffLimited, nlopt.ForcedStop):
        optimiser.optimize(np.clip(start, low, high))
    return _best(objective, layout, sorted(evaluated, key=lambda entry: entry[0]))


def _settled(merits: list[float]) -> bool:
    """Whether the last several evaluations together brought next to nothing."""
    if len(merits) <= _SEVERAL:
        return False
    before, now = min(merits[:-_SEVERAL]), min(merits)
    return before - now <= _ENOUGH * abs(before)


def _best(objective: Objective, layout: Layout, evaluated: list[tuple[float, Floats]]) -> ViewTable:
    """The best of what was seen that keeps to the constraints; the start if nothing is better."""
    design, best = objective.design, layout.view_table(layout.start)
    value = objective.value(best)
    for criterion, numbers in evaluated:
        if criterion >= value:
            break
        views = layout.view_table(numbers)
        if permitted(design, views):
            best, value = views, criterion
            break
    # What is met in the limit only is left by a hair: from the lowest of all a little back.
    views = _back(design, layout, evaluated[0][1])
    return views if permitted(design, views) and objective.value(views) < value else best


def _back(design: DesignSpace, layout: Layout, numbers: Floats) -> ViewTable:
    for _ in range(_BACK):
        views = layout.view_table(numbers)
        wrong = ~allowed(design, views)
        if cost(design, views) > total(design):
            wrong[:] = True
        if not wrong.any():
            break
        numbers = layout.nearer(numbers, wrong)
    return layout.view_table(numbers)


def permitted(design: DesignSpace, views: ViewTable) -> bool:
    """Whether views keep clear of keep-outs, and within their limits and the budget."""
    limits = design.limits[views.kind]
    slack = 1e-9 * (1 + np.abs(limits[..., 0]))
    first = AZIMUTH + 1 if design.constraints.full_circle else AZIMUTH
    inside = (views.table >= limits[..., 0] - slack) & (views.table <= limits[..., 1] + slack)
    if not inside[:, first:].all() or cost(design, views) > total(design):
        return False
    return bool(allowed(design, views).all())


def _constrain(optimiser: Any, design: DesignSpace, layout: Layout) -> None:
    begin, budget = layout.view_table(layout.start), design.constraints.budget
    places = begin.places(design)
    for keepout in design.constraints.keepouts:
        clear, _ = design.clearance(keepout, places)
        near = np.flatnonzero(clear <= layout.reach)
        if len(near):
            tolerance = np.full(len(near), _TOLERANCE)
            entered = _entering(design, layout, keepout, near)
            optimiser.add_inequality_mconstraint(entered, tolerance)
    exposures = design.limits[begin.kind, EXPOSURE]
    if budget is not None and budget.per_exposure > 0 and np.ptp(exposures, axis=1).any():
        optimiser.add_inequality_constraint(_spending(design, layout), 0.0)


def _entering(
    design: DesignSpace, layout: Layout, keepout: KeepOut, near: NDArray[np.intp]
) -> Callable[[Floats, Floats, Floats], None]:
    """How deep some views are in a keep-out, in target diameters, for the optimiser."""
    unit = design.target.diameter

    def entered(result: Floats, numbers: Floats, slope: Floats) -> None:
        views = layout.view_table(numbers)
        clear, by_place = design.clearance(keepout, views.take(near).places(design))
        result[:] = -clear / unit
        if slope.size:
            by_table = np.zeros((len(near), len(views), COLUMNS))
            by_table[np.arange(len(near)), near] = _by_row(design, views.take(near), by_place)
            slope[:] = -layout.pulled_back(numbers, by_table) / unit

    return entered


def _by_row(design: DesignSpace, views: ViewTable, by_place: Floats) -> Floats:
    """Derivatives by places (V, 3) as derivatives by rows of the table, (V, 7)."""
    along = (views.frames(design) @ by_place[:, :, None])[..., 0]
    distance, level = views.table[:, DISTANCE], np.cos(views.table[:, ELEVATION])
    rows = np.zeros((len(views), COLUMNS))
    rows[:, DISTANCE] = along[:, 0]
    rows[:, AZIMUTH] = along[:, 1] * distance * level
    rows[:, ELEVATION] = along[:, 2] * distance
    return rows


def _spending(design: DesignSpace, layout: Layout) -> Callable[[Floats, Floats], float]:
    """By how much of the budget views cost too much, for the optimiser."""
    budget = design.constraints.budget
    assert budget is not None

    def spent(numbers: Floats, slope: Floats) -> float:
        views = layout.view_table(numbers)
        if slope.size:
            by_table = np.zeros((1, len(views), COLUMNS))
            by_table[..., EXPOSURE] = budget.per_exposure / budget.total
            slope[:] = layout.pulled_back(numbers, by_table)[0]
        return cost(design, views) / budget.total - 1

    return spent
