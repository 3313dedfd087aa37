"""Convergence of the solvers with and without ramp preconditioning.

Three phantoms of smooth and sharp parts, projected by the exact transform of their pixels with
noise added; each solver runs from zero, and every image on its way is scored.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.images import decode, encode
from paper.plan import Plan
from rift_cl import Device, Grid, Parallel, Projector, Report, metrics, phantom
from rift_cl.reconstruct import Cgls, Fista, Pdhg, Sirt
from rift_cl.reconstruct.solvers.solver import Solver
from rift_cl.reference.radon import radon
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_png, image_grid

NAME = "convergence"
TITLE = "Convergence with and without ramp preconditioning"
VIEWS, NOISES = 96, (0.05, 0.25)
ANGLES = ("uniform", "random")
# Weight of the variation at a noise s, in units of s: smooth parts vary by some 0.01 a pixel.
TV_WEIGHT = 2.0
STEPS = {"CGLS": 60, "SIRT": 400, "FISTA-TV": 160, "PDHG-TV": 160}
QUICK_STEPS = {"CGLS": 30, "SIRT": 150, "FISTA-TV": 60, "PDHG-TV": 100}
WEIGHTS = (None, "ramp", "capped-voronoi")
# The iteration that pictures are of.
SHOWN = 5
COLUMNS = ("angles, noise, solver", "weight", "best PSNR", "steps to best - 1 dB",
           "steps at the stop", "PSNR at the stop")  # fmt: skip
CAPTION = (
    "Means over the phantoms, in dB within the inscribed disc. The stop is where the solver, told "
    "the noise, ends by itself; a dash where it did not for every phantom. All go on beyond it."
)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {**plan.size(), "views": VIEWS, "noises": list(NOISES), "steps": _steps(plan)}


def _steps(plan: Plan) -> dict[str, int]:
    return STEPS if plan.full else QUICK_STEPS


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Scores of every run; one phantom in the quick version, and three in the full one."""
    size, count = (96, 3) if plan.full else (64, 1)
    rows = list(kept.get("rows", []))
    result: dict[str, Any] = {"size": size, "rows": rows}
    cases = list(itertools.product(ANGLES, NOISES, STEPS, WEIGHTS))
    for angles, noise, solver, weight in cases[len(rows) :]:
        case = (angles, noise, solver, weight)
        rows.append(_row(size, count, device, case, _steps(plan)[solver]))
        yield result
    yield result


def _row(
    size: int, count: int, device: Device, case: tuple[str, float, str, str | None], steps: int
) -> dict[str, Any]:
    angles, noise, name, weight = case
    grid = Grid((size, size))
    scan = Parallel(_angles(angles), bins=int(size * 1.43))
    A, exact, inside = Projector(grid, scan, device=device), radon(grid, scan), metrics.disc(grid)
    runs, picture = [], None
    for seed in range(count):
        truth = _phantom(grid, seed)
        y = exact.project(truth) + noise * np.random.default_rng(seed).standard_normal(A.range)
        run: dict[str, Any] = {"psnr": [], "residual": [], "stop": None}
        for report, image in _whole_run(A, y, case, steps, run):
            run["psnr"].append(round(metrics.psnr(image, truth, mask=inside), 3))
            run["residual"].append(float(f"{report.values['residual']:.4g}"))
            if seed == 0 and report.done == SHOWN:
                picture = encode(image, (0.0, 1.0))
        runs.append(run)
    row = {"angles": angles, "noise": noise, "solver": name, "weight": weight}
    return {**row, "runs": runs, "picture": picture}


def _whole_run(
    A: Projector, y: Any, case: tuple[str, float, str, str | None], steps: int, run: dict[str, Any]
) -> Iterator[tuple[Report, NDArray[np.float32]]]:
    """Reports and images to the stop, which is noted, and beyond it."""
    _, noise, name, weight = case
    told = _solver(A, y, name, TV_WEIGHT * noise, precondition=weight, noise=noise)
    for report in told.run(steps):
        yield report, A.device.get(told.image)
        run["stop"] = report.done if told.finished else None
    beyond = _solver(A, y, name, TV_WEIGHT * noise, precondition=told.data.weight)
    beyond.restore(told.state())
    for report in beyond.run(steps):
        yield report, A.device.get(beyond.image)


def _solver(A: Projector, y: Any, name: str, variation: float, **given: Any) -> Solver:
    if name == "CGLS":
        return Cgls(A, y, **given)
    if name == "SIRT":
        return Sirt(A, y, nonnegative=True, **given)
    method = Fista if name == "FISTA-TV" else Pdhg
    return method(A, y, variation, nonnegative=True, **given)


def _angles(kind: str) -> NDArray[np.float64]:
    if kind == "uniform":
        return np.arange(VIEWS) * np.pi / VIEWS
    return np.sort(np.random.default_rng(7).uniform(0, np.pi, VIEWS))


def _phantom(grid: Grid, seed: int) -> NDArray[np.float64]:
    """The Shepp-Logan head, or soft ellipses with a rough texture, between 0 and 1."""
    if seed == 2:
        return phantom.shepp_logan(grid).astype(np.float64)
    random = np.random.default_rng(seed + 1)
    size = grid.shape[0]
    y, x = np.meshgrid(grid.coordinates(0), grid.coordinates(1), indexing="ij")
    image = np.zeros(grid.shape)
    for _ in range(12):
        a, b = random.uniform(0.04, 0.2, 2) * size
        turn, (x0, y0) = random.uniform(0, np.pi), random.uniform(-0.22, 0.22, 2) * size
        u = (x - x0) * np.cos(turn) + (y - y0) * np.sin(turn)
        v = (y - y0) * np.cos(turn) - (x - x0) * np.sin(turn)
        distance = (np.hypot(u / a, v / b) - 1) * min(a, b)
        image += random.uniform(-0.4, 1) / (1 + np.exp(np.clip(distance, -50, 50)))
    along = np.fft.fftfreq(size)
    k = np.maximum(np.hypot(along[:, None], along), 1 / size)
    texture = np.fft.ifft2(np.fft.fft2(random.standard_normal(grid.shape)) * k**-1.5).real
    inside = metrics.disc(grid, radius=size / 2 - 2)
    image = (image + 0.15 * texture / texture.std()) * inside
    image = (image - image.min()) * inside
    return np.asarray(image / image.max())


def summary(row: dict[str, Any]) -> tuple[float, float, float | None, float | None]:
    """Best PSNR, steps to 1 dB below it, steps at the stop and the PSNR there; means over runs."""
    best, near, steps, stopped = [], [], [], []
    for run in row["runs"]:
        psnr = np.array(run["psnr"])
        best.append(psnr.max())
        near.append(int(np.argmax(psnr >= psnr.max() - 1)) + 1)
        if run["stop"]:
            steps.append(run["stop"])
            stopped.append(psnr[run["stop"] - 1])
    all_met = len(steps) == len(best)
    at_stop = (float(np.mean(steps)), float(np.mean(stopped))) if all_met else (None, None)
    return float(np.mean(best)), float(np.mean(near)), *at_stop


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the table, and for each noise and kind of angles the curves and the pictures."""
    rows = result["rows"]
    labels = [f"{r['angles']}, {r['noise']:g}, {r['solver']}" for r in rows]
    table = [
        (label, r["weight"] or "none", *summary(r)) for label, r in zip(labels, rows, strict=True)
    ]
    page.table(COLUMNS, table, caption=CAPTION)
    for angles, noise in itertools.product(ANGLES, NOISES):
        here = [r for r in rows if (r["angles"], r["noise"]) == (angles, noise)]
        if here:
            _show_case(page, f"{angles} angles, noise {noise:g}", here)


def _show_case(page: Page, title: str, rows: list[dict[str, Any]]) -> None:
    drawn = [r for r in rows if r["weight"] != "capped-voronoi"]
    for key, label in (("psnr", "PSNR, dB"), ("residual", "log10 of the residual")):
        series = {}
        for row in drawn:
            values = np.mean([run[key] for run in row["runs"]], axis=0)
            values = values if key == "psnr" else np.log10(values)
            name = row["solver"] + (" + ramp" if row["weight"] else "")
            series[name] = (np.arange(1, len(values) + 1), values)
        figure = curves(series, xlabel="iterations", ylabel=label, log_x=True, title=title)
        page.figure(figure_png(figure), caption=f"{label}, {title}", alt=f"{label} by iterations")
    pairs = [[r for r in drawn if r["weight"] == weight] for weight in WEIGHTS[:2]]
    if len(pairs[0]) == len(pairs[1]):
        images = [decode(r["picture"]) for r in itertools.chain(*pairs)]
        titles = [r["solver"] for r in pairs[0]] + [""] * len(pairs[1])
        labels = ["no weight", "ramp"]
        grid = image_grid(
            images,
            titles=titles,
            columns=len(STEPS),
            row_labels=labels,
            window=(0.0, 1.0),
            size=1.2,
        )
        caption = f"The first phantom after {SHOWN} iterations, {title}"
        page.figure(figure_png(grid), caption=caption, alt=caption)
