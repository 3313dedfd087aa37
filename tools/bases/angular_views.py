"""Lobes from few noisy views: what a splat that some cameras have seen can tell of its colour.

Directions are drawn evenly over the hemisphere, samples have one per cent of noise, coefficients a
ridge of 1e-4; the error is over the whole hemisphere, so that what was not seen counts as well. The
error against the number of views says from where on a rich basis pays.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bases.lobe_families import Family, budget
from bases.lobe_fits import fit_lobe
from bases.lobes import Hemisphere, lobe_values
from bases.plan import Plan
from bases.statistics import distinct, paired, sentence, spread, values
from bench.table import Table
from rift_cl import Device
from rift_cl.basis import SphericalHarmonics
from rift_cl.report.plot import curves

NAME = "angular_views"
TITLE = "View-dependent colour: few noisy views"
BASELINE = "SH 27"
LOBES = (
    "phong 16",
    "ggx 0.20",
    "ggx 0.35",
    "aniso 0.15 x 0.6",
    "mix",
    "two lobes",
    "skyline",
)
NOISE, RIDGE = 0.01, 1e-4


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    views = plan.of(tiny=(24,), quick=(24, 64, 192), full=(12, 24, 48, 64, 96, 192, 384))
    lobes = plan.of(tiny=1, quick=4, full=7)
    starts = plan.of(tiny=1, quick=2, full=6)
    return {**plan.settings(), "views": list(views), "lobes": lobes, "starts": starts}


def families() -> dict[str, Family]:
    """What is compared, under names that hold the number of RGB parameters."""
    mean = Family("mean only", "sh", SphericalHarmonics(0), np.arange(1), 3)
    wanted = {
        1: ("SH", "LG row", "SG"),
        2: ("SH", "HG", "LG row", "HG anisotropic", "SG", "ASG"),
        3: ("SH", "LG row"),
    }
    found = {"mean only": mean}
    for degree, names in wanted.items():
        for family in budget(degree):
            if family.name in names:
                found[f"{family.name} {family.parameters}"] = family
    return found


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The error of every basis, number of views, lobe and seed."""
    asked = settings(plan)
    sphere = Hemisphere.gauss(plan.of(tiny=8, quick=16, full=32))
    wanted = [
        (seed, views, lobe)
        for seed in plan.seeds
        for views in asked["views"]
        for lobe in LOBES[: asked["lobes"]]
    ]
    done = {(run["seed"], run["views"], run["lobe"]) for run in kept["runs"]}
    result = {"total": len(wanted) * len(families()), "runs": list(kept["runs"])}
    for seed, views, lobe in wanted:
        if (seed, views, lobe) not in done:
            result["runs"] += _runs(sphere, seed, views, lobe, asked["starts"])
        yield result


def _runs(
    sphere: Hemisphere, seed: int, views: int, lobe: str, starts: int
) -> list[dict[str, Any]]:
    random = np.random.default_rng([seed, views, *lobe.encode()])
    height, turn = random.uniform(0, 1, views), random.uniform(0, 2 * np.pi, views)
    across = np.sqrt(1 - height**2)
    seen = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=-1)
    samples = lobe_values(lobe, seen, seed) + NOISE * random.normal(size=views)
    truth = lobe_values(lobe, sphere.directions, seed)
    found = []
    for name, family in families().items():
        fit = fit_lobe(
            family,
            *(seen, samples, np.ones(views)),
            ridge=RIDGE,
            starts=starts,
            random=np.random.default_rng(seed),
        )
        error = sphere.rms(fit(sphere.directions) - truth)
        found.append({"basis": name, "views": views, "lobe": lobe, "seed": seed, "rms": error})
    return found


def tables(result: dict[str, Any]) -> Iterator[Table]:
    """Errors by the number of views; means over lobes, spread over seeds."""
    runs = result["runs"]
    bases = distinct(runs, "basis")
    rows = [
        [str(views), *(spread(_by_seed(runs, basis, views), ".3f") for basis in bases)]
        for views in distinct(runs, "views")
    ]
    yield Table("Mean RMS error over the hemisphere, by views", ["views", *bases], rows)


def _by_seed(runs: list[dict[str, Any]], basis: str, views: int) -> list[float]:
    return [
        float(np.mean(values(runs, "rms", basis=basis, views=views, seed=seed)))
        for seed in distinct(runs, "seed")
    ]


def pictures(result: dict[str, Any]) -> dict[str, tuple[Any, str]]:
    """The error against the number of views."""
    runs = result["runs"]
    views = distinct(runs, "views")
    series = {
        basis: (views, [np.mean(values(runs, "rms", basis=basis, views=n)) for n in views])
        for basis in distinct(runs, "basis")
    }
    figure = curves(series, xlabel="views", ylabel="mean RMS error", log_x=True, log_y=True)
    return {"views": (figure, "Mean RMS error over the whole hemisphere against noisy views")}


def verdicts(result: dict[str, Any]) -> list[str]:
    """Every basis against SH of degree 2, view count by view count."""
    runs, said = result["runs"], []
    for views in distinct(runs, "views"):
        mine = [run for run in runs if run["views"] == views]
        for basis in distinct(mine, "basis"):
            if basis != BASELINE:
                gain = paired(
                    mine, basis, BASELINE, what="rms", keys=("lobe", "seed"), lower_is_better=True
                )
                where = f"{views} views"
                said.append(sentence(basis, BASELINE, gain, "of RMS error taken off", where))
    return said
