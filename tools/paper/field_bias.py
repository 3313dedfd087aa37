"""Which frequencies splats and small radiance fields learn first, on the same photographs.

All see the same views of the ornament; splats take the steps of the plan, and each field as much
processor time as they took. What is compared is the shape of the error's spectrum, on the ring and
off it, beside how densely the views sample each frequency.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.coordinate_network import torch_is_missing
from paper.fits import fit_settings
from paper.moments import start
from paper.plan import Plan
from paper.unseen_views import UnseenViews, field_moments, splat_moments
from rift_cl import Device, coverage
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.geometry import Camera
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svgs
from rift_cl.sampling import Target
from rift_cl.train.start.points import focus_of

NAME = "field_bias"
TITLE = "Spectral bias of splats and of small radiance fields"
SPLATS = {"splats": 0.0, "splats, ramp": 0.5}
# Standard deviations of Fourier features; None for the hash grid. With the ramp, or without.
FIELDS = {
    "hash grid": (None, False),
    "hash grid, ramp": (None, True),
    "features 1": (1.0, False),
    "features 4": (4.0, False),
    "features 16": (16.0, False),
}
_DIRECTIONS = 64
# Steps of the fits that kernels are compiled by.
_WARM = 12
Floats = NDArray[np.float32]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result, but for the speed of the machine."""
    return {**plan.size(), **plan.fits(), "views": max(plan.counts)}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Spectra of every model, by its processor time; fields are left out without torch."""
    count, seed = max(plan.counts), plan.seeds[0]
    runs = {run["model"]: run for run in kept.get("runs", [])}
    asked = fit_settings(plan, count, seed=seed)
    trainer, pictures = start(asked, device)
    means = device.get(trainer.parameters.drawn.means)
    box = means.min(axis=0), means.max(axis=0)
    views = UnseenViews(device, asked.test[1:], pictures, 12 if plan.full else 1)
    found: list[dict[str, Any]] = []
    result = {
        "frequency": views.frequency.tolist(),
        "density": _density(pictures.cameras, views.frequency, device),
        "views": count,
        "runs": found,
    }
    if any(model not in runs for model in SPLATS):
        _warm(plan, count, device)
    for model, exponent in SPLATS.items():
        if model not in runs:
            trainer, _ = start(fit_settings(plan, count, exponent=exponent, seed=seed), device)
            runs[model] = {"model": model, "moments": list(splat_moments(trainer, views))}
        found.append(runs[model])
        yield result
    budget = found[0]["moments"][-1]["cpu_s"]
    for model, (sigma, ramp) in {} if torch_is_missing() else FIELDS.items():
        if model not in runs:
            fit = field_fit(plan, pictures, box, sigma, ramp)
            runs[model] = {"model": model, "moments": list(field_moments(fit, budget, views))}
        found.append(runs[model])
        yield result


def _warm(plan: Plan, count: int, device: Device) -> None:
    """Have all kernels compiled by short fits, so that no time of splats counts that."""
    short = replace(plan, steps=min(plan.steps, _WARM))
    for exponent in SPLATS.values():
        trainer, _ = start(
            fit_settings(short, count, exponent=exponent, seed=plan.seeds[0]), device
        )
        while trainer.parameters.step < short.steps:
            trainer.step()
    device.finish()


def field_fit(
    plan: Plan,
    pictures: CapturePictures,
    box: tuple[Floats, Floats],
    sigma: float | None,
    ramp: bool,
) -> Any:
    """A field in the box where the first splats were, before its first step."""
    import torch

    from paper.small_field import QUICK, FieldFit, FieldSize, FourierFeatures, HashGrid, SmallField

    seed = plan.seeds[0]
    torch.manual_seed(seed)
    size = FieldSize() if plan.full else QUICK
    encoding = HashGrid(size) if sigma is None else FourierFeatures(size, sigma)
    field = SmallField(size, encoding, box, pictures.behind)
    images = [pictures.over(k, pictures.behind) for k in range(len(pictures.views))]
    return FieldFit(field, images, list(pictures.cameras), ramp=ramp, seed=seed)


def _density(cameras: Sequence[Camera], frequency: Any, device: Device) -> list[float]:
    """Mean coverage over all directions of a frequency at the focus, over its highest."""
    focus = focus_of(cameras)
    distance = float(np.median([np.linalg.norm(c.center - focus) for c in cameras]))
    pixel = distance / cameras[0].intrinsics[0]
    random = np.random.default_rng(0).standard_normal((_DIRECTIONS, 3))
    ways = random / np.linalg.norm(random, axis=1, keepdims=True)
    width = min(cameras[0].size) * pixel
    k = (frequency[:, None, None] / pixel * ways).reshape(-1, 3)
    found = coverage(cameras, Target(focus, width), k, device=device)[0]
    mean = found.reshape(len(frequency), _DIRECTIONS).mean(axis=1)
    return (mean / mean.max()).tolist()


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the density, the spectra, and the table."""
    frequency, runs = result["frequency"], result["runs"]
    page.paragraph(
        f"{result['views']} views of the ornament. Each field has the processor time of the "
        "splats without the ramp. Power of the error over that of the photographs, by frequency: "
        "a bias is the shape of a curve, not its height."
    )
    words = "How densely the views sample a frequency, by coverage, over its highest."
    draw_curves(page, {"coverage": (frequency, result["density"])}, "density", words, log_y=True)
    for group in ("ring", "off the ring"):
        series = {
            run["model"]: (frequency, 10 * np.log10(run["moments"][-1][group]["error"]))
            for run in runs
        }
        words = f"Relative error at the end of unseen photographs: {group}."
        draw_curves(page, series, "error / truth, dB", words)
    moments_table(page, runs)
    page.paragraph(
        "Not claimed: which kind of model is better. The fields are small, in plain torch, without "
        "the occupancy grids and fused kernels that make such fields fast; one seed, one scene. "
        "Occlusion breaks the slice theorem, so that coverage tells what views could sample, not "
        "what they saw. Photographs' own noise is part of the errors at the highest frequencies."
    )


def moments_table(page: Page, runs: Sequence[dict[str, Any]]) -> None:
    """The scores of models on the way."""
    rows = [
        (run["model"], m["step"], m["cpu_s"], m["ring"]["psnr"], m["off the ring"]["psnr"])
        for run in runs
        for m in run["moments"]
    ]
    columns = ("model", "step", "processor s", "PSNR, ring", "PSNR, off the ring")
    page.table(columns, rows, caption="Mean PSNR in dB of unseen photographs on the way.")


def draw_curves(
    page: Page, series: dict[str, tuple[Any, Any]], label: str, words: str, *, log_y: bool = False
) -> None:
    """Draw series by frequency, with ``words`` below."""
    figure = figure_svgs(
        lambda width: curves(
            series,
            xlabel="spatial frequency, cycles per pixel",
            ylabel=label,
            log_x=True,
            log_y=log_y,
            width=width,
        )
    )
    page.figure(figure, caption=words, alt=words)
