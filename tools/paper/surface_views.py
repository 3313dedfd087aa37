"""Whether the merit of views of a surface ranks them as what they tell of a sphere of splats.

Not a figure of the paper; a first look at a merit that was never tried. An opaque sphere of flat
splats has an unknown random texture, with or without a sheen of unknown direction. Pictures are
linear in the splats' colours, so that the error of the best estimate of them can be computed
without drawing any: the renderer gives each picture's matrix, occlusion and all. What counts is the
error of pictures from all round, most of them off the path of the views. The shape is taken as
known, which flatters every score: a fit has to find it as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.plan import Plan
from paper.score_scatter import score_scatter
from rift_cl import Device, merit
from rift_cl.geometry import Camera, look_at
from rift_cl.reference.splat_projection import spherical_harmonics
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png
from rift_cl.sampling import PowerLaw, Target
from rift_cl.splat import Renderer, Splats

NAME = "surface_views"
TITLE = "A merit of views of a surface against what they tell of it"
FAMILIES = ("ring", "two rings", "cap", "clustered", "random", "spiral")
SCORES = {
    "surface": "surface merit",
    "texture": "its texture part",
    "volume": "merit of a volume",
    "gap": "largest hole",
}
# Degree of the harmonics of the truth, by the name of its look.
LOOKS = {"matt": 0, "glossy": 1}
SPLATS, PIXELS, FOCAL, DISTANCE, VIEWS = 300, 40, 66.0, 4.0, 12
# Noise of a pixel and standard deviation of each harmonic, where texture varies by 1.
NOISE, SHEEN, LENGTH = 1.0, 0.5, 0.3
_BAND, _ALPHA, _TEST = 2.4, 3.0, 40

Floats = NDArray[np.float64]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {**plan.size(), "sets": _sets(plan)}


def _sets(plan: Plan) -> int:
    return 6 if plan.full else 2


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Scores and errors of every set of views, look by look."""
    result = kept or {"cases": []}
    for look in list(LOOKS)[len(result["cases"]) :]:
        sphere = Sphere(device, LOOKS[look])
        sets = []
        for family in FAMILIES:
            for seed in range(_sets(plan)):
                places = viewpoints(family, seed)
                found = {"scores": sphere.scores(places), "error": sphere.error(places)}
                sets.append({"family": family, **found})
        result["cases"].append({"look": look, "sets": sets})
        yield result


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the table of correlations, and every set's error against its scores."""
    if not result["cases"]:
        return
    page.paragraph(
        f"{len(result['cases'][0]['sets'])} sets of {VIEWS} views of {len(FAMILIES)} kinds of a "
        f"sphere of {SPLATS} opaque splats, {PIXELS} x {PIXELS} pixels each. The error is the "
        f"share of the variance of {_TEST} pictures from all round that the best linear estimate "
        "leaves unknown. 'glossy' has first-degree harmonics of unknown size in every splat."
    )
    rows = [
        (case["look"], *(f"{value:.3f}" for value in correlations(case).values()))
        for case in result["cases"]
    ]
    page.table(
        ("look", *SCORES.values()),
        rows,
        caption="Spearman's correlation of each score of a set of views with the error.",
    )
    for case in result["cases"]:
        page.figure(
            figure_png(scatter(case)),
            caption=f"A {case['look']} sphere: error against three scores; each dot is a set.",
            alt="Dots of error against score",
        )


def correlations(case: dict[str, Any]) -> dict[str, float]:
    """Spearman's correlation of every score with the error."""
    from scipy.stats import spearmanr

    errors = [one["error"] for one in case["sets"]]
    return {
        name: float(spearmanr([one["scores"][name] for one in case["sets"]], errors).statistic)
        for name in SCORES
    }


def viewpoints(family: str, seed: int) -> Floats:
    """Unit vectors (VIEWS, 3) towards views of a kind, drawn from a seed."""
    random = np.random.default_rng([FAMILIES.index(family), seed])
    steps, turn = np.arange(VIEWS), random.uniform(0, 2 * np.pi)
    if family in ("ring", "two rings"):
        rise = random.uniform(-0.2, 1.1)
        up = np.where(steps % 2, rise, rise - (random.uniform(0.4, 1.2) if "two" in family else 0))
        around = turn + 2 * np.pi * steps / VIEWS
        return np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], 1)
    if family == "spiral":
        height = 1 - (steps + 0.5) / VIEWS * random.uniform(0.8, 2)
        around = turn + steps * np.pi * (1 + np.sqrt(5))
        across = np.sqrt(1 - height**2)
        return np.stack([across * np.cos(around), across * np.sin(around), height], 1)
    spread = {"random": 9.0, "cap": random.uniform(0.5, 1.2), "clustered": 0.4}[family]
    towards = random.normal(size=(1 if family != "clustered" else 3, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    found = towards[steps % len(towards)] + spread * random.normal(size=(VIEWS, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def camera_at(place: Floats) -> Camera:
    """A camera in a direction from the sphere's middle."""
    K = [[FOCAL, 0, PIXELS / 2], [0, FOCAL, PIXELS / 2], [0, 0, 1]]
    up = np.eye(3)[np.argmin(np.abs(place))]
    return Camera((PIXELS, PIXELS), K, look_at(DISTANCE * place, (0, 0, 0), up))


def spiral(count: int) -> Floats:
    """Unit vectors (count, 3) evenly over the sphere."""
    steps = np.arange(count)
    height, around = 1 - 2 * (steps + 0.5) / count, steps * np.pi * (1 + np.sqrt(5))
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(around), across * np.sin(around), height], 1)


class Sphere:
    """A sphere of splats of unknown colours, and what views tell of them.

    Args:
        device: where splats are drawn.
        degree: of the harmonics of their colours.
    """

    def __init__(self, device: Device, degree: int) -> None:
        self.device, self.degree, self.middles = device, degree, spiral(SPLATS)
        size = 0.6 * np.sqrt(4 * np.pi / SPLATS)
        tilt = np.column_stack(
            [1 + self.middles[:, 2], -self.middles[:, 1], self.middles[:, 0], np.zeros(SPLATS)]
        )
        self.splats = Splats.upload(
            device,
            means=self.middles,
            quats=tilt,
            scales=np.tile([size, size, size / 10], (SPLATS, 1)),
            opacities=np.full(SPLATS, 0.95),
            colors=np.eye(SPLATS),
        )
        self.renderer = Renderer(device=device)
        apart = np.linalg.norm(self.middles[:, None] - self.middles, axis=2)
        scale = np.r_[1.0, np.full((degree + 1) ** 2 - 1, SHEEN**2)]
        self.prior = np.kron(np.exp(-apart / LENGTH), np.diag(scale))
        self.test = sum(self.information(place) for place in spiral(_TEST))
        first = 2 * np.pi * LENGTH**2 / (1 + (np.pi * LENGTH) ** 2) ** 1.5
        pixel = (DISTANCE - 1) / FOCAL
        self.target = Target(
            (0, 0, 0), 2.0, spiral(60), spiral(60), "surface", PowerLaw(_ALPHA),
            first / (NOISE * pixel) ** 2, _BAND,
        )  # fmt: skip

    def information(self, place: Floats) -> Floats:
        """What one picture tells of all coefficients, before it is divided by the noise."""
        frame = self.renderer.forward(self.splats, camera_at(place))
        seen = self.device.get(frame.image).reshape(-1, SPLATS).astype(np.float64)
        basis = spherical_harmonics(self.middles - DISTANCE * place, self.degree)
        basis *= np.sqrt(4 * np.pi)
        rows = (seen.T @ seen)[:, None, :, None] * basis[:, :, None, None] * basis
        return np.asarray(rows.reshape(basis.size, basis.size))

    def error(self, places: Floats) -> float:
        """Share of the variance of test pictures that the best linear estimate leaves."""
        told = sum(self.information(place) for place in places) / NOISE**2
        left = np.linalg.solve(np.eye(len(self.prior)) + self.prior @ told, self.prior)
        return float((left * self.test).sum() / (self.prior * self.test).sum())

    def scores(self, places: Floats) -> dict[str, float]:
        """Every score of a set of views; lower is better."""
        cameras, target = [camera_at(place) for place in places], self.target
        volume = Target((0, 0, 0), 2.0, prior=target.prior, snr=target.snr, band=target.band)
        nearest = np.clip((spiral(2000) @ places.T).max(1), -1, 1)
        return {
            "surface": merit(cameras, replace(target, degree=self.degree)).value,
            "texture": merit(cameras, replace(target, degree=0)).value,
            "volume": merit(cameras, volume).value,
            "gap": float(np.arccos(nearest.min())),
        }


def scatter(case: dict[str, Any]) -> Any:
    """A figure of error against score, a panel for each of three scores."""
    sets = case["sets"]
    return score_scatter(
        [one["family"] for one in sets],
        {
            SCORES[name]: [one["scores"][name] for one in sets]
            for name in ("surface", "volume", "gap")
        },
        [one["error"] for one in sets],
        "unknown share of test pictures",
    )
