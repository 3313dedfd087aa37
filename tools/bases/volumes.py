"""Volumes from projections: random ellipsoids in a ball, exact line integrals.

Splats stand in space and are projected exactly along parallel rays, with signed coefficients and
nothing clamped. Views are spread evenly over half a turn; what is scored is the volume, not its
projections, so that few views show what a basis makes up between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bases.additive import Geometry
from bases.additive_fit import EXACT, AdditiveFit, Floats, Task, psnr, race, record
from bases.densities import density
from bases.mode_sets import ModeSet, directions, in_space
from bases.plan import Plan
from bases.races import race_pictures, race_tables, race_verdicts
from bases.starts import ball_start
from bases.views import additive_renderer, turned_cameras
from rift_cl import Device, Grid, Parallel
from rift_cl.phantom import Ellipsoid, project, render

NAME = "volumes"
TITLE = "Tomography of volumes by additive splats"
# Share of half the grid that the ellipsoids' middles and the splats lie in.
_BALL = 0.75
_ELLIPSOIDS = 10
# Parameters beyond which exact solves would take most of a fit's time.
_EXACTLY = 1000


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {
        **plan.settings(),
        "cases": plan.of(tiny=[[12, 3, 60]], quick=[[24, 24, 400]], full=CASES),
        "orders": plan.of(tiny=[0, 1], quick=[0, 1, 2], full=[0, 1, 2, 3]),
        "solves": plan.of(tiny=[2, EXACT], quick=[4, EXACT], full=[4, 12, EXACT]),
        "marks": plan.of(tiny=[2], quick=[5, 10, 20, 30, 45, 60, 90, 120], full=MARKS),
        "short": plan.of(tiny=2, quick=30, full=60),
    }


# Samples along an edge, views, parameters.
CASES = [[24, 6, 400], [24, 24, 400], [24, 24, 800], [40, 40, 2000]]
MARKS = [5, 10, 20, 30, 45, 60, 90, 120, 180, 240]


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Every case and seed, the bases in turns."""
    asked = settings(plan)
    sets = [in_space(order) for order in asked["orders"]]
    wanted = [(seed, *case) for case in asked["cases"] for seed in plan.seeds]
    done = {(run["seed"], run["samples"], run["views"], run["budget"]) for run in kept["runs"]}
    result = {
        "total": sum(len(sets) * len(solvers(asked["solves"], case[-1])) for case in wanted),
        "short": asked["short"],
        "runs": list(kept["runs"]),
    }
    for seed, samples, views, budget in wanted:
        if (seed, samples, views, budget) not in done:
            task = ellipsoid_task(device, samples, views, seed)
            fits = [
                AdditiveFit(task, modes, modes.splats(budget, 1), solve)
                for modes in sets
                for solve in solvers(asked["solves"], budget)
            ]
            race(fits, asked["marks"])
            case = {"samples": samples, "views": views, "budget": budget}
            result["runs"] += [record(fit, seed=seed, target="ellipsoids", **case) for fit in fits]
        yield result


def solvers(solves: list[int], budget: int) -> list[int]:
    """Which of the solvers are for a budget: exact ones for no more than they are quick with."""
    return [solve for solve in solves if solve != EXACT or budget <= _EXACTLY]


def ellipsoid_task(device: Device, samples: int, views: int, seed: int) -> Task:
    """Ten ellipsoids of a seed on a cube of samples, seen from so many directions."""
    parts, grid = random_ellipsoids(samples, seed), Grid((samples, samples, samples))
    scan = Parallel(np.arange(views) * np.pi / views, samples)
    targets = project(parts, grid, scan).astype(np.float64)[..., None]
    truth = render(parts, grid).astype(np.float64)
    line = np.arange(samples) - (samples - 1) / 2
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)

    def score(
        geometry: Geometry, modes: ModeSet, coefficients: Floats, residual: Floats
    ) -> dict[str, float]:
        found = density(geometry, modes, coefficients, points).reshape(truth.shape)
        return {
            "psnr": psnr(found - truth, float(truth.max())),
            "data_psnr": psnr(residual, float(targets.max())),
        }

    return Task(
        additive_renderer(device, tile=8, eps2d=0.0),
        turned_cameras(samples, samples, scan.angles),
        targets,
        np.ones(10),
        lambda count: ball_start(count, _BALL * samples / 2, seed),
        0.5,
        samples / 2,
        score,
        directions(48),
        4 / 3,
    )


def random_ellipsoids(samples: int, seed: int) -> list[Ellipsoid]:
    """Solid ellipsoids with middles in a ball, turned about z."""
    random = np.random.default_rng([0xE111, seed])
    half, parts = samples / 2, []
    for _ in range(_ELLIPSOIDS):
        way = random.normal(size=3)
        middle = 0.7 * _BALL * half * np.cbrt(random.uniform()) * way / np.linalg.norm(way)
        axes = half * random.uniform(0.12, 0.4, 3)
        turn, value = random.uniform(0, np.pi), random.uniform(0.2, 1.0)
        parts.append(Ellipsoid(tuple(middle), tuple(axes), turn, value))
    return parts


tables, pictures, verdicts = race_tables, race_pictures, race_verdicts
