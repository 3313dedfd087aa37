"""What ``rift fit`` shows: pictures it never saw beside the truth, errors, scores, the loss."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rift_cl.html_page import Page
from rift_cl.jobs.few import evenly
from rift_cl.jobs.fit_scores import ViewScore
from rift_cl.plot import curves, figure_png, image_grid

_SHOWN = 3
# Errors are shown this much brighter.
ERROR_GAIN = 5.0

SCORING = (
    "PSNR in dB (peak 1) and SSIM in display light, means over the pictures. The foreground is "
    "what differs from the background by more than two codes, or what alpha says. 'nearest' and "
    "'blend' are the nearest training picture and the mean of the two nearest: what no fit scores."
)
COLUMNS = ("pictures", "score", "fit", "nearest", "blend")


def score_rows(metrics: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """The table of mean scores: a row for each group of pictures and kind of score."""
    rows = []
    for group, values in metrics["scores"].items():
        for kind, label in (
            ("psnr", "PSNR"), ("psnr_foreground", "PSNR foreground"), ("ssim", "SSIM")
        ):  # fmt: skip
            if f"fit_{kind}" in values:
                cells = (values.get(f"{name}_{kind}", float("nan")) for name in COLUMNS[2:])
                rows.append((group, label, *cells))
    return rows


def fit_page(
    name: str,
    groups: Mapping[str, Sequence[ViewScore]],
    losses: Sequence[tuple[int, float]],
    metrics: Mapping[str, Any],
) -> Page:
    """The report of a finished fit."""
    basis = f", {metrics['basis']}" if "basis" in metrics else ""
    page = Page(f"Splats fitted to {name}", f"{metrics['splats']} splats{basis}")
    show_fit(page, groups, losses, metrics)
    return page


def show_fit(
    page: Page,
    groups: Mapping[str, Sequence[ViewScore]],
    losses: Sequence[tuple[int, float]],
    metrics: Mapping[str, Any],
) -> None:
    """Add to a page: mean scores, truth, fit and error of each group's pictures, the loss."""
    if metrics["scores"]:
        page.table(COLUMNS, score_rows(metrics), caption=SCORING)
    for group, scores in groups.items():
        page.section(f"Pictures: {group}")
        page.figure(
            figure_png(view_panels(scores)),
            caption=f"The best, the middle and the worst by PSNR; errors {ERROR_GAIN:g} times "
            "brighter.",
            alt="Pictures that were not trained on: truth, fit, error",
        )
        rows = [_row(score) for score in scores]
        columns = ("picture", "degrees away", "PSNR", "SSIM", "blend PSNR")
        page.table(columns, rows, caption="Away from the nearest picture that was trained on.")
    page.section("Training")
    steps, values = zip(*losses, strict=True)
    figure = curves({"loss": (steps, values)}, xlabel="step", ylabel="loss")
    page.figure(figure_png(figure), caption="Of the pictures as they came.", alt="Loss by step")


def _row(score: ViewScore) -> tuple[Any, ...]:
    values = score.values
    blend = values.get("blend_psnr", float("nan"))
    return (score.name, score.angle, values["fit_psnr"], values["fit_ssim"], blend)


def view_panels(scores: Sequence[ViewScore]) -> Any:
    """Truth, picture and error of the best, the middle and the worst by PSNR."""
    order = sorted(scores, key=lambda score: -score.values["fit_psnr"])
    places = evenly(len(order), _SHOWN)
    images, titles = [], []
    for place in places:
        score = order[place]
        error = np.abs(score.image - score.truth) * ERROR_GAIN
        images += [score.truth, score.image, np.clip(error, 0, 1)]
        titles += [score.name, f"{score.values['fit_psnr']:.1f} dB", "error"]
    return image_grid(images, titles=titles, columns=3, window=(0.0, 1.0))
