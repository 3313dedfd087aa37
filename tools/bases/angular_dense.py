"""Lobes of outgoing light, sampled densely and without noise.

Thirteen lobes on the hemisphere, each fitted in every basis at the numbers of RGB parameters that
spherical harmonics of degree 1, 2 and 3 take: coefficients by ridge least squares, axes and widths
by Gauss and Newton from several starts. The root mean square error is relative to a peak of one. A
seed moves the light and draws the starts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bases.lobe_families import budget
from bases.lobe_fits import fit_lobe
from bases.lobes import LOBES, Hemisphere, lobe_values
from bases.plan import Plan
from bases.statistics import distinct, paired, sentence, spread, values
from bench.table import Table
from rift_cl import Device
from rift_cl.report.plot import curves

NAME = "angular_dense"
TITLE = "View-dependent colour: lobes from dense samples"
BASELINE = "SH"
DEGREES = (1, 2, 3)
_RIDGE = 1e-9


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    lobes = plan.of(tiny=("phong 16",), quick=tuple(LOBES)[1::3], full=tuple(LOBES))
    rings, starts = plan.of(tiny=(8, 1), quick=(12, 2), full=(48, 6))
    return {**plan.settings(), "lobes": list(lobes), "rings": rings, "starts": starts}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The error of every lobe, basis, budget and seed."""
    asked = settings(plan)
    wanted = [
        (seed, degree, lobe)
        for seed in plan.seeds
        for degree in plan.of(tiny=(1, 2), quick=DEGREES, full=DEGREES)
        for lobe in asked["lobes"]
    ]
    done = {(run["seed"], run["degree"], run["lobe"]) for run in kept["runs"]}
    total = sum(len(budget(degree)) for _, degree, _ in wanted)
    result = {"total": total, "runs": list(kept["runs"])}
    sphere = Hemisphere.gauss(asked["rings"])
    for seed, degree, lobe in wanted:
        if (seed, degree, lobe) not in done:
            result["runs"] += _runs(sphere, seed, degree, lobe, asked["starts"])
        yield result


def _runs(
    sphere: Hemisphere, seed: int, degree: int, lobe: str, starts: int
) -> list[dict[str, Any]]:
    truth = lobe_values(lobe, sphere.directions, seed)
    found = []
    for family in budget(degree):
        random = np.random.default_rng([seed, degree, *lobe.encode()])
        fit = fit_lobe(
            family,
            *(sphere.directions, truth, sphere.weights),
            ridge=_RIDGE,
            starts=starts,
            random=random,
        )
        found.append(
            {
                "basis": family.name,
                "degree": degree,
                "parameters": family.parameters,
                "lobe": lobe,
                "seed": seed,
                "rms": sphere.rms(fit(sphere.directions) - truth),
            }
        )
    return found


def tables(result: dict[str, Any]) -> Iterator[Table]:
    """One table for every budget."""
    runs = result["runs"]
    for degree in distinct(runs, "degree"):
        mine = [run for run in runs if run["degree"] == degree]
        names = {run["basis"]: run["parameters"] for run in mine}
        rows = [
            [lobe, *(spread(values(mine, "rms", lobe=lobe, basis=b), ".4f") for b in names)]
            for lobe in distinct(mine, "lobe")
        ]
        means = [f"{np.mean(values(mine, 'rms', basis=b)):.4f}" for b in names]
        yield Table(
            f"RMS error at the budget of SH degree {degree}",
            ["lobe", *(f"{b}, {n}" for b, n in names.items())],
            [*rows, ["mean", *means]],
            ["Beside each basis: its RGB parameters; mean and spread over the seeds."],
        )


def pictures(result: dict[str, Any]) -> dict[str, tuple[Any, str]]:
    """Mean error against parameters."""
    runs = result["runs"]
    series = {}
    for basis in distinct(runs, "basis"):
        mine = [run for run in runs if run["basis"] == basis]
        counts = distinct(mine, "parameters")
        series[basis] = counts, [np.mean(values(mine, "rms", parameters=n)) for n in counts]
    figure = curves(series, xlabel="RGB parameters", ylabel="mean RMS error", log_y=True)
    return {"parameters": (figure, "Mean RMS error over all lobes against RGB parameters")}


def verdicts(result: dict[str, Any]) -> list[str]:
    """Every basis against spherical harmonics, at each budget."""
    runs, keys = result["runs"], ("lobe", "seed")
    said = []
    for degree in distinct(runs, "degree"):
        mine = [run for run in runs if run["degree"] == degree]
        for basis in distinct(mine, "basis"):
            if basis != BASELINE:
                gain = paired(mine, basis, BASELINE, what="rms", keys=keys, lower_is_better=True)
                where = f"budget of degree {degree}"
                said.append(sentence(basis, BASELINE, gain, "of RMS error taken off", where))
    return said
