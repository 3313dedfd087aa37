"""Choose views greedily among candidates, then refine them to a local minimum of the criterion."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, check_type, checked_flag
from rift_cl.geometry import Camera
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.numbers import one_number
from rift_cl.sampling.criteria.merit import CoverageCriterion
from rift_cl.sampling.planning.baselines import Baseline, baselines
from rift_cl.sampling.planning.candidates import candidates, looked_at, most_candidates
from rift_cl.sampling.planning.coincident import parted
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.design_space import DesignSpace, default_types
from rift_cl.sampling.planning.free_layout import FreeLayout
from rift_cl.sampling.planning.frequency_sets import for_planning
from rift_cl.sampling.planning.greedy import Limits, bound, choose
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.path_search import best_path
from rift_cl.sampling.planning.paths import Free
from rift_cl.sampling.planning.pool import pool_of
from rift_cl.sampling.planning.refine import refine
from rift_cl.sampling.planning.view_costs import check_paid, prices, total
from rift_cl.sampling.planning.view_plan import Plan
from rift_cl.sampling.planning.view_table import ViewTable, turned
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import checked_power
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
Method = Literal["greedy", "greedy+mma"]
_MOST_VIEWS = 100_000
# Frequencies that hold a target's power, below which a plan is not to be trusted.
_FEW = 6
# Starts that are moved, and for how many steps until the best of them alone goes on; none that is
# so much worse than the best, as a share, comes to win.
_MOVED, _TRIED, _HOPELESS = 3, 10, 0.1
# By which part the criterion may grow so that no two views stand at one place: 0.02 dB.
_PARTING = 5e-3


def plan(
    target: Target,
    views: int,
    constraints: Constraints | None = None,
    cameras: Sequence[CameraType] = (),
    *,
    method: Method = "greedy+mma",
    fixed: Sequence[Camera] | Plan = (),
    seed: int = 0,
    kind: CoverageCriterion = "wiener",
    compare: bool = True,
) -> Plan:
    """Choose camera poses that minimize a criterion.

    All views look at the target's centre, upright about ``constraints.up``. Free views are chosen
    one after another among some 500 directions with each camera type; from there, or from the best
    simple arrangement where that is better, all are moved together (method of moving asymptotes,
    analytic gradient). Views on a path share one type and setting. A target that names no
    frequencies is planned at four times as many as it has by itself; a surface that does not say
    from where it will be looked at, for directions in which its cameras may stand. Where a simple
    arrangement is already best, the plan may lie some tenths of a per cent above it, since no two
    of its views are left at one place and it is judged at other frequencies: ``Plan.verdict`` then
    calls the two as good as each other.

    Args:
        target: what is looked at.
        views: how many; fewer where a budget ends first.
        constraints: what they keep to; none when not given.
        cameras: what they can be taken with, lengths in the unit of the world; when none is given,
            a camera that is sharp everywhere and finer than the target's band.
        method: ``greedy`` leaves the second step out.
        fixed: views that were taken already; the new ones go where those left most unknown.
        seed: turns the candidates; the same gives the same plan.
        kind: the criterion: ``wiener``, ``logdet`` or ``worst``.
        compare: whether simple arrangements are tried as well, as starts and to compare with, and
            a bound is looked for; without, the plan has neither, in a third of the time.

    Raises:
        InputError: an argument makes no sense, or no view keeps to the constraints.
    """
    if not (one_number(views).is_integer() and 1 <= views <= _MOST_VIEWS):
        raise InputError(f"plan: views is {views!r}, wanted a whole number, 1 or more")
    for name, value, known in (("method", method, Method), ("kind", kind, CoverageCriterion)):
        if value not in get_args(known):
            raise InputError(f"plan: {name} is {value!r}, wanted one of {get_args(known)}")
    limits = Constraints() if constraints is None else constraints
    check_type("plan", "target", target, Target)
    check_type("plan", "constraints", limits, Constraints)
    check_type("plan", "cameras", cameras, Sequence)
    check_type("plan", "seed", seed, Integral)
    checked_flag("plan", "compare", compare)
    target = looked_at(target, limits)
    fine = for_planning(target, most_candidates(int(views)))
    design = DesignSpace(fine, limits, tuple(cameras) or default_types(target))
    check_paid(design)
    _warn_of_few_frequencies(fine)
    taken, weights = _taken(fixed, design)
    observed = Observations.of(taken, target.points, weights) if taken else None
    objective = Objective(design, kind, observed, target)
    simple = baselines(objective, int(views), seed) if compare else {}
    found, least = _chosen(objective, int(views), method, seed, simple)
    view_table = ViewTable(found.kind, turned(found.table, design))
    if compare and len(view_table) < views:
        simple = baselines(objective, len(view_table), seed)
    reached = objective.value(view_table)
    return Plan(objective, view_table, reached, min(least, reached), taken, weights, simple)


def next_views(
    taken: Plan | Sequence[Camera],
    target: Target,
    views: int,
    constraints: Constraints | None = None,
    cameras: Sequence[CameraType] = (),
    *,
    method: Method = "greedy+mma",
    seed: int = 0,
    kind: CoverageCriterion = "wiener",
    compare: bool = True,
) -> Plan:
    """Choose further views, given those that were taken.

    Args:
        taken: a plan that was carried out, whose constraints and camera types hold on where none
            are given; or the cameras of the views.
        target: what is looked at, with what is now known of it: ``Pilot(reconstruction, spacing)``
            for its prior turns new views to where the first found detail.
        views: how many more; the rest as for ``plan``.
        constraints: what they keep to.
        cameras: what they can be taken with.
        method: as for ``plan``.
        seed: as for ``plan``.
        kind: as for ``plan``.
        compare: as for ``plan``.

    Raises:
        InputError: nothing was taken, or as for ``plan``.
    """
    if not isinstance(taken, Plan):
        check_type("next_views", "taken", taken, Sequence)
    if not isinstance(taken, Plan) and not len(taken):
        raise InputError("next_views: no view was taken, wanted a plan or cameras; see plan")
    if isinstance(taken, Plan):
        constraints = taken.objective.design.constraints if constraints is None else constraints
        cameras = cameras or taken.objective.design.types
    return plan(
        target,
        views,
        constraints,
        cameras,
        method=method,
        fixed=taken,
        seed=seed,
        kind=kind,
        compare=compare,
    )


def _warn_of_few_frequencies(target: Target) -> None:
    """Say so where a steep prior leaves a few frequencies to decide about all views."""
    power = checked_power(target.prior, target.k, target.diameter)
    count = float(power.sum() ** 2 / (power**2).sum())
    if target.mode == "volume" and count < _FEW:
        warnings.warn(
            f"the target's power lies in about {count:.0f} of its {len(power)} frequencies, and "
            "views would be fitted to those: lower its band to where power is above noise, or "
            "give more frequencies (rift_cl.sampling.targets.target.half_ball)",
            stacklevel=3,
        )


def _chosen(
    objective: Objective, views: int, method: Method, seed: int, simple: Mapping[str, Baseline]
) -> tuple[ViewTable, float]:
    """The views, and a lower bound of the criterion."""
    design = objective.design
    offered = candidates(objective, views, seed)
    pool = pool_of(objective, offered)
    if isinstance(design.constraints.path, Free):
        choice = choose(pool, Limits(views, prices(design, offered), total(design)))
        found = offered.take(choice.order)
        if method == "greedy+mma":
            found = _moved(objective, found, simple)
    else:
        found = best_path(objective, views, moved=method == "greedy+mma")
    if not simple:
        return found, -np.inf
    whole = ViewTable.joined([offered, found])
    limits = Limits(views, prices(design, whole), total(design))
    places = list(range(len(offered), len(whole)))
    return found, bound(pool.with_views(found), limits, places)


def _moved(objective: Objective, chosen: ViewTable, simple: Mapping[str, Baseline]) -> ViewTable:
    """The best of what was chosen and of simple arrangements, refined."""
    design, spacing = objective.design, FreeLayout(objective.design, chosen).trust
    starts = [chosen, *(baseline.view_table for baseline in simple.values())]
    values = [objective.value(start) for start in starts]
    order = sorted(range(len(starts)), key=values.__getitem__)[:_MOVED]
    first, worst = starts[order[0]], (1 + _HOPELESS * np.sign(values[order[0]])) * values[order[0]]
    layouts = [
        FreeLayout(design, parted(design, starts[n], spacing)) for n in order if values[n] <= worst
    ]
    tried = [refine(objective, layout, _TRIED) for layout in layouts]
    winner = layouts[int(np.argmin([objective.value(views) for views in tried]))]
    # From its start again: who begins anew where it came to is let too far from there.
    best = min((first, *tried, refine(objective, winner)), key=objective.aside.value)
    # In a corner of what is allowed views may meet again: a little apart they are worth as much.
    value = objective.value(best)
    for share in (1, 0.25, 0.05):
        apart = parted(design, best, share * spacing)
        if objective.value(apart) <= value + _PARTING * abs(value):
            return apart
    return best


def _taken(
    fixed: Sequence[Camera] | Plan, design: DesignSpace
) -> tuple[tuple[Camera, ...], Floats]:
    """The views that were taken, and the relative photons of each."""
    if isinstance(fixed, Plan):
        light = fixed.objective.design.brightness / design.brightness
        weights = np.concatenate([fixed.fixed_weights, fixed.weights])
        return (*fixed.fixed, *fixed.cameras), weights * light
    return tuple(fixed), np.array([_photons(camera, design) for camera in fixed])


def _photons(camera: Camera, design: DesignSpace) -> float:
    """Relative photons of a camera of unknown exposure; 1 where even its aperture is unknown."""
    if not isinstance(camera, Camera):
        raise InputError(f"plan: fixed holds {camera!r}, wanted cameras")
    if camera.aperture is None:
        return 1.0
    distance = float(np.linalg.norm(camera.center - design.target.center))
    return (2 * camera.aperture.radius / distance) ** 2 / design.brightness
