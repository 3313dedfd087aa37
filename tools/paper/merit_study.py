"""Whether a merit ranks sets of views as the errors of real reconstructions rank them.

Not a figure of the paper; it bears out the merit that views are planned by. Objects in a disc on
96 x 96 samples are projected from a grid twice as fine along many sets of directions, with noise of
0.25 on ray sums, and reconstructed in two ways: conjugate gradients that end when the residual is
down to the noise, and the best linear estimate for the objects' mean spectrum. Every score of a
set is computed before, without objects; what counts is how its ranking of the sets agrees with that
of the mean squared errors, by Spearman's correlation. The more objects are drawn out in one
direction, the less the gaps between directions say of the errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.angle_families import FAMILIES, family_angles, gaps
from paper.known_objects import KINDS, NOISE, SIZE, Objects, best_linear
from paper.plan import Plan
from paper.random_objects import RADIUS
from paper.score_scatter import score_scatter
from rift_cl import Device, Grid, Parallel, Projector, cgls
from rift_cl.metrics import disc
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png
from rift_cl.sampling import Observations, Target, criterion_of_coverage
from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.criteria.exact import exact
from rift_cl.sampling.criteria.kriging import kriging
from rift_cl.sampling.criteria.merit import CoverageCriterion

NAME = "merit_study"
TITLE = "A merit of views against the errors of reconstructions"
SCORES = {
    "wiener": "Wiener",
    "logdet": "bits",
    "worst": "worst direction",
    "kriging": "kriging",
    "exact": "exact 24 x 24",
    "gap": "largest gap",
    "gaps": "sum of squared gaps",
}
_BY_COVERAGE: tuple[CoverageCriterion, ...] = ("wiener", "logdet", "worst")
METHODS = ("CGLS", "MAP")
COUNTS = (12, 32)
# Correlation that the merit must have, and what it must be ahead of the largest gap by.
GATES = {"isotropic": (0.9, None), "anisotropic": (0.8, 0.3)}
# Of conjugate gradients, at the most.
_STEPS = 30

Floats = NDArray[np.float64]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    sets, objects = _extent(plan)
    return {**plan.size(), "sets": sets, "objects": objects, "noise": NOISE}


def _extent(plan: Plan) -> tuple[int, int]:
    """Sets of each family, and objects."""
    return (6, 8) if plan.full else (3, 4)


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Scores and errors of every set, case by case."""
    result = kept or {"cases": []}
    sets, count = _extent(plan)
    wanted = [(kind, views) for kind in KINDS for views in COUNTS]
    for kind, views in wanted[len(result["cases"]) :]:
        objects = Objects(kind, count)
        rows = [
            {"family": family, **_row(objects, family_angles(family, views, seed), seed, device)}
            for family in FAMILIES
            for seed in range(sets)
        ]
        result["cases"].append({"kind": kind, "views": views, "sets": rows})
        yield result


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the table of correlations, and every set's error against its scores."""
    if not result["cases"]:
        return
    sets = len(result["cases"][0]["sets"])
    page.paragraph(
        f"{sets} sets of directions of {len(FAMILIES)} kinds for each case; objects in a disc on "
        f"{SIZE} x {SIZE} samples, those called anisotropic with details "
        f"{KINDS['anisotropic']:g} times as long in one direction, of known spectrum. Noise of "
        f"{NOISE:g} on ray sums. CGLS ends where the residual is down to the noise, MAP is the "
        "best linear estimate for the objects' mean spectrum. Wanted of the Wiener merit: "
        + "; ".join(_gate(kind) for kind in KINDS)
        + "."
    )
    rows = [
        (case["kind"], case["views"], method, *(f"{found[name]:.3f}" for name in SCORES),
         "yes" if passes(case["kind"], found) else "no")
        for case in result["cases"]
        for method, found in correlations(case).items()
    ]  # fmt: skip
    page.table(
        ("objects", "views", "method", *SCORES.values(), "as wanted"),
        rows,
        caption="Spearman's correlation of each score of a set with the mean squared error.",
    )
    for case in result["cases"]:
        page.figure(
            figure_png(scatter(case)),
            caption=f"{case['kind']} objects, {case['views']} views: error of the best linear "
            "estimate against three scores; each dot is a set of directions.",
            alt="Dots of error against score",
        )


def _gate(kind: str) -> str:
    least, ahead = GATES[kind]
    more = "" if ahead is None else f" and {ahead:g} more than the largest gap"
    return f"{least:g} for {kind} objects{more}"


def scatter(case: dict[str, Any]) -> Any:
    """A figure of error against score, a panel for each of three scores."""
    sets = case["sets"]
    return score_scatter(
        [one["family"] for one in sets],
        {
            SCORES[name]: [one["scores"][name] for one in sets]
            for name in ("wiener", "exact", "gap")
        },
        [one["errors"]["MAP"] for one in sets],
        "mean squared error",
    )


def _row(objects: Objects, angles: Floats, seed: int, device: Device) -> dict[str, Any]:
    return {
        "scores": scores(angles, objects.target),
        "errors": errors(objects, angles, seed, device),
    }


def scores(angles: Floats, target: Target) -> dict[str, float]:
    """Every score of a set of directions; lower is better."""
    observations = Observations.of_scan(Parallel(angles, SIZE))
    between = gaps(angles)
    known = host_coverage(observations, target.k, target.diameter)
    return {
        **{kind: criterion_of_coverage(kind, known, target).value for kind in _BY_COVERAGE},
        "kriging": kriging(observations, target),
        "exact": exact(observations, target),
        "gap": float(between.max()),
        "gaps": float((between**2).sum()),
    }


def errors(objects: Objects, angles: Floats, seed: int, device: Device) -> dict[str, float]:
    """Mean squared error in the disc by method, mean over the objects."""
    count, scan = len(objects.truth), Parallel(angles, SIZE)
    A = Projector(Grid((count, SIZE, SIZE)), scan, device=device)
    source = Grid((count, 2 * SIZE, 2 * SIZE), (1, 0.5, 0.5))
    y = Projector(source, scan, device=device)(objects.fine).astype(np.float64)
    y += NOISE * np.random.default_rng([seed, len(angles)]).standard_normal(y.shape)
    inside = disc(Grid((SIZE, SIZE)), radius=RADIUS * SIZE)
    found = {"CGLS": cgls(A, y, _STEPS, noise=NOISE), "MAP": best_linear(A, y, objects.power)}
    return {
        name: float(((image - objects.truth)[:, inside] ** 2).mean())
        for name, image in found.items()
    }


def correlations(case: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Spearman's correlation of every score with the error of every method."""
    from scipy.stats import spearmanr

    sets = case["sets"]
    return {
        method: {
            score: float(
                spearmanr(
                    [one["scores"][score] for one in sets], [one["errors"][method] for one in sets]
                ).statistic
            )
            for score in SCORES
        }
        for method in METHODS
    }


def passes(kind: str, found: dict[str, float]) -> bool:
    """Whether the correlations of one method satisfy the gates."""
    least, ahead = GATES[kind]
    enough = found["wiener"] >= least
    return enough and (ahead is None or found["wiener"] >= found["gap"] + ahead)
