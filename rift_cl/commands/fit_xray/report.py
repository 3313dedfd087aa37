"""What ``rift fit xray`` shows: slices of splats and of voxels, projections, the loss."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.commands.fit_xray.scores import score_table
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.pictures.slice_pictures import (
    ENOUGH,
    FRAMES,
    UPRIGHT,
    display_window,
    show_slices,
    smaller,
)
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svgs

# Samples between two slices that stand side by side.
_GAP = 4

Floats = NDArray[np.float32]


def xray_page(
    name: str,
    slices: tuple[Floats, Floats],
    groups: Mapping[str, Sequence[ViewScore]],
    losses: Sequence[tuple[int, float]],
    metrics: Mapping[str, Any],
    notes: Sequence[str] = (),
    unit: str = "",
) -> Page:
    """The report of a finished fit.

    Args:
        name: of the scan.
        slices: the splats' and the filtered backprojection's, (z, y, x) each, in one unit.
        groups: scores of held-out projections by the name of their group.
        losses: by step.
        metrics: the figures of the fit.
        notes: sentences about it.
        unit: of the scan's lengths; empty where it is not known.
    """
    basis = f", {metrics['basis']}" if "basis" in metrics else ""
    page = Page(f"Splats fitted to {name}", f"{metrics['splats']} splats, X-rays{basis}")
    _show_slices(page, *slices, unit or "unit of length")
    if metrics["scores"]:
        page.section("Scores")
        columns, rows, caption = score_table(metrics)
        page.table(columns, rows, caption=caption)
    for group, scores in groups.items():
        _show_projections(page, group, scores)
    page.section("Training")
    steps, values = zip(*losses, strict=True)
    draw = partial(curves, {"loss": (steps, values)}, xlabel="step", ylabel="loss")
    figure = figure_svgs(lambda width: draw(width=width))
    page.figure(figure, caption="Of the projections as they came.", alt="Loss by step")
    shown = {k: v for k, v in metrics.items() if isinstance(v, (int, float, str))}
    for note in notes:
        page.paragraph(note)
    page.facts(shown)
    return page


def _show_projections(page: Page, group: str, scores: Sequence[ViewScore]) -> None:
    page.section(f"Projections: {group}")
    page.figure(
        figure_svgs(partial(_profile, scores)),
        caption="The middle row of the worst by PSNR: line integrals by detector bin.",
        alt="Line integrals of a held-out projection: truth and fit",
    )
    columns = ("projection", "degrees away", "PSNR", "error", "fbp PSNR", "blend PSNR")
    page.table(columns, [_row(score) for score in scores], caption="Away from the nearest.")


def _row(score: ViewScore) -> tuple[Any, ...]:
    names = ("fit_psnr", "fit_error", "fbp_psnr", "blend_psnr")
    return (score.name, score.angle, *(score.values[name] for name in names))


def _show_slices(page: Page, splats: Floats, voxels: Floats, unit: str) -> None:
    """Sliders through z and, of more than a few slices, through planes along the axis."""
    across = evenly(len(splats), min(len(splats), FRAMES))
    few = across[:: len(across) // 8 + 1]
    window = display_window([volume[k] for k in few for volume in (splats, voxels)])
    what = (
        f"Attenuation per {unit}: left of the splats, as means over voxels, right by "
        "filtered backprojection of the same views, or what stands in for it"
    )
    show_slices(
        page,
        [_side_by_side(splats[k], voxels[k], window[1]) for k in across],
        labels=[f"slice {k}" for k in across],
        window=window,
        what=f"{what}; slices across the axis",
    )
    if len(splats) < ENOUGH:
        return
    along = evenly(splats.shape[1], min(splats.shape[1], UPRIGHT))
    show_slices(
        page,
        [_side_by_side(splats[:, k], voxels[:, k], window[1]) for k in along],
        labels=[f"y {k}" for k in along],
        window=window,
        what=f"{what}; planes along the axis",
    )


def _side_by_side(left: Floats, right: Floats, white: float) -> Floats:
    left, right = smaller(left), smaller(right)
    gap = np.full((len(left), _GAP), white, np.float32)
    return np.concatenate([left, gap, right], axis=1)


def _profile(scores: Sequence[ViewScore], width: int) -> Any:
    worst = min(scores, key=lambda score: score.values["fit_psnr"])
    row = len(worst.truth) // 2
    bins = np.arange(worst.truth.shape[1])
    series = {"truth": (bins, worst.truth[row]), "fit": (bins, worst.image[row])}
    return curves(series, xlabel="detector bin", ylabel="line integral", width=width)
