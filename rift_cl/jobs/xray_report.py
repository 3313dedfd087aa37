"""What ``rift fit --mode xray`` shows: slices of splats and of voxels, projections, the loss."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.html_page import Page
from rift_cl.jobs.few import evenly
from rift_cl.jobs.fit_scores import ViewScore
from rift_cl.jobs.xray_scores import COLUMNS, SCORING, score_rows
from rift_cl.plot import curves, figure_png, image_grid

_SLICES = 3
# The display window leaves out this share of the darkest and of the brightest samples.
_TAIL = 0.5

Floats = NDArray[np.float32]


def xray_page(
    name: str,
    slices: tuple[Floats, Floats],
    groups: Mapping[str, Sequence[ViewScore]],
    losses: Sequence[tuple[int, float]],
    metrics: Mapping[str, Any],
) -> Page:
    """The report of a finished fit.

    Args:
        name: of the scan.
        slices: the splats' and the filtered backprojection's, (z, y, x) each, in one unit.
        groups: scores of unseen projections by the name of their group.
        losses: by step.
        metrics: the figures of the fit.
    """
    basis = f", {metrics['basis']}" if "basis" in metrics else ""
    page = Page(f"Splats fitted to {name}", f"{metrics['splats']} splats, X-rays{basis}")
    if metrics["scores"]:
        page.table(COLUMNS, score_rows(metrics), caption=SCORING)
    page.section("Slices")
    page.figure(
        figure_png(_slices(*slices)),
        caption="Attenuation per unit of length: of the splats, as means over voxels, and by "
        "filtered backprojection of the same views.",
        alt="Slices of the splats beside those of filtered backprojection",
    )
    for group, scores in groups.items():
        _show_projections(page, group, scores)
    page.section("Training")
    steps, values = zip(*losses, strict=True)
    figure = curves({"loss": (steps, values)}, xlabel="step", ylabel="loss")
    page.figure(figure_png(figure), caption="Of the projections as they came.", alt="Loss by step")
    shown = {k: v for k, v in metrics.items() if isinstance(v, (int, float, str))}
    page.facts(shown)
    return page


def _show_projections(page: Page, group: str, scores: Sequence[ViewScore]) -> None:
    page.section(f"Projections: {group}")
    page.figure(
        figure_png(_profile(scores)),
        caption="The middle row of the worst by PSNR: line integrals by detector bin.",
        alt="Line integrals of an unseen projection: truth and fit",
    )
    columns = ("projection", "degrees away", "PSNR", "error", "fbp PSNR", "blend PSNR")
    page.table(columns, [_row(score) for score in scores], caption="Away from the nearest.")


def _row(score: ViewScore) -> tuple[Any, ...]:
    names = ("fit_psnr", "fit_error", "fbp_psnr", "blend_psnr")
    return (score.name, score.angle, *(score.values[name] for name in names))


def _slices(splats: Floats, voxels: Floats) -> Any:
    count = len(splats)
    few = evenly(count, min(count, _SLICES))
    images = [volume[k] for k in few for volume in (splats, voxels)]
    titles = [f"{name}, slice {k}" for k in few for name in ("splats", "fbp")]
    low, high = np.percentile(np.stack(images), [_TAIL, 100 - _TAIL])
    window = (float(low), float(high) if high > low else float(low) + 1)
    return image_grid(images, titles=titles, columns=2, window=window, size=5.0)


def _profile(scores: Sequence[ViewScore]) -> Any:
    worst = min(scores, key=lambda score: score.values["fit_psnr"])
    row = len(worst.truth) // 2
    bins = np.arange(worst.truth.shape[1])
    series = {"truth": (bins, worst.truth[row]), "fit": (bins, worst.image[row])}
    return curves(series, xlabel="detector bin", ylabel="line integral")
