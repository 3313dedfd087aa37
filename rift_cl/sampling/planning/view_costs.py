"""What views cost, and what a budget pays for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.sampling.planning.design_space import EXPOSURE, DesignSpace
from rift_cl.sampling.planning.view_table import ViewTable

# Sums are compared with the budget up to this part of it.
_ROUNDING = 1e-9


def prices(design: DesignSpace, views: ViewTable) -> NDArray[np.float64]:
    """(V,) what each view costs; 0 without a budget."""
    budget = design.constraints.budget
    if budget is None:
        return np.zeros(len(views))
    rows = zip(views.kind.tolist(), views.table[:, EXPOSURE].tolist(), strict=True)
    return np.array([budget.cost(design.types[kind].name, exposure) for kind, exposure in rows])


def cost(design: DesignSpace, views: ViewTable) -> float:
    """What views cost together; 0 without a budget."""
    return math.fsum(prices(design, views).tolist())


def total(design: DesignSpace) -> float:
    """The budget, with room for rounding; infinite without one."""
    budget = design.constraints.budget
    return math.inf if budget is None else budget.total * (1 + _ROUNDING)


def paid(design: DesignSpace, kind: int, exposure: float, views: int) -> int:
    """How many views of a type, each of one exposure, the budget pays for; ``views`` at most."""
    if design.constraints.budget is None:
        return views
    price = design.constraints.budget.cost(design.types[kind].name, exposure)
    return views if price <= 0 else min(views, int(total(design) / price))


def affordable(design: DesignSpace, kind: int, views: int) -> float:
    """The longest exposure of a type that the budget pays for in every view."""
    low, high = design.limits[kind, EXPOSURE]
    budget = design.constraints.budget
    if budget is None or budget.per_exposure == 0:
        return float(high)
    rest = budget.total / views - budget.cost(design.types[kind].name, 0.0)
    return float(np.clip(rest / budget.per_exposure, low, high))


def check_paid(design: DesignSpace) -> None:
    """Refuse a budget that pays for no view.

    Raises:
        InputError: it does not.
    """
    budget = design.constraints.budget
    if budget is None:
        return
    least = {
        kind.name: budget.cost(kind.name, float(limits[EXPOSURE, 0]))
        for kind, limits in zip(design.types, design.limits, strict=True)
    }
    name, price = min(least.items(), key=lambda entry: entry[1])
    if price > total(design):
        raise InputError(
            f"Budget: {budget.total:g} pays for no view: the cheapest, by camera {name!r}, costs "
            f"{price:g}"
        )
