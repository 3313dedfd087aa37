"""What ``rift fit`` shows: pictures it never saw beside the truth, errors, scores, the loss."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import compress
from typing import Any

import numpy as np

from rift_cl.commands.fit_photos.comparison import COMPARED, compared_means
from rift_cl.commands.fit_photos.error_places_report import show_error_places
from rift_cl.commands.fit_photos.scores import ViewScore, brightness_of
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.report.html_page import Compared, Page
from rift_cl.report.plot import curves, figure_svgs, jpeg
from rift_cl.train.loss.homogenisation import ENOUGH_VIEWS, USUAL_EXPONENT

_SHOWN = 3
# A fit of photographs of one exposure is off by a percent or so in brightness from one to the next.
_STEADY = 0.04
# Share of the squared error that factors of brightness must explain to be worth a sentence.
_EXPLAINED = 0.35
# Errors are shown this much brighter.
ERROR_GAIN = 5.0

SCORING_ALONE = (
    "PSNR in dB (peak 1) and SSIM in display light, means over the pictures. The foreground is "
    "what differs from the background by more than two codes, or what alpha says."
)
SCORING = (
    f"{SCORING_ALONE} 'nearest' and 'blend' are the nearest training picture and the mean of the "
    "two nearest: what no fit scores. Means beside each other are over the same pictures."
)
_AS_GIVEN = (
    " 'fit' is drawn with the poses and exposures that were fitted to the scored pictures "
    "themselves, 'as given' without."
)
COLUMNS = ("pictures", "score", "fit", "as given", *COMPARED[2:])
# Kinds of scores and what tables call them.
SCORES = {
    "psnr": "PSNR",
    "psnr_foreground": "PSNR foreground",
    "ssim": "SSIM",
    "flip": "FLIP (0 is best)",
    "lpips": "LPIPS (0 is best)",
}


def score_rows(metrics: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """The table of mean scores: a row for each group of pictures and kind of score.

    None stands where nothing can be compared.
    """
    return [
        (group, label, *(kinds[kind].get(name) for name in COMPARED))
        for group, kinds in metrics["compared"].items()
        for kind, label in SCORES.items()
        if kind in kinds
    ]


def score_table(metrics: Mapping[str, Any]) -> tuple[Sequence[str], list[tuple[Any, ...]], str]:
    """Columns and rows of mean scores, and a caption; without what nothing is compared with."""
    rows = score_rows(metrics)
    known = [True, True, *(any(row[k] is not None for row in rows) for k in range(2, len(COLUMNS)))]
    caption = SCORING if all(known[-2:]) else SCORING_ALONE
    caption += _AS_GIVEN if known[3] else ""
    return list(compress(COLUMNS, known)), [tuple(compress(row, known)) for row in rows], caption


def fit_page(
    name: str,
    groups: Mapping[str, Sequence[ViewScore]],
    losses: Sequence[tuple[int, float]],
    metrics: Mapping[str, Any],
    notes: Sequence[str] = (),
    scene: str | None = None,
) -> Page:
    """The report of a finished fit.

    Args:
        name: of the capture.
        groups: scores of pictures by the name of their group.
        losses: step and loss.
        metrics: all figures.
        notes: sentences about what it decided by itself.
        scene: a page beside the report that draws the scene, if there is one.
    """
    basis = f", {metrics['basis']}" if "basis" in metrics else ""
    page = Page(f"Splats fitted to {name}", f"{metrics['splats']} splats{basis}")
    if scene is not None:
        page.link("Walk round the scene in this browser", scene)
    show_fit(page, groups, losses, metrics)
    if notes:
        page.section("What was decided")
        for note in notes:
            page.paragraph(note)
    return page


def history_notes(history: Sequence[tuple[int, int]]) -> list[str]:
    """A sentence about the stages of a fit that was trained on."""
    if len(history) < 2:
        return []
    stages = [f"to step {until} by the schedules of a fit of {steps}" for until, steps in history]
    return [f"It was trained {', then '.join(stages)}."]


def octave_notes(metrics: Mapping[str, Any]) -> list[str]:
    """A sentence about photographs that were halved at first."""
    if "octaves" not in metrics:
        return []
    ended = metrics["octaves"]["ended"]
    times = "once" if len(ended) == 1 else f"{len(ended)} times"
    steps = " and ".join(str(step) for step in reversed(ended))
    return [
        f"The photographs were halved {times} at first, until the residual was smaller than what "
        f"the halving leaves out: the size changed after step {steps}, and so does the scale of "
        "the loss (--octaves)."
    ]


def brightness_notes(scores: Sequence[ViewScore]) -> list[str]:
    """A sentence about exposures that change, where they were not fitted."""
    spread, explained = brightness_of(scores)
    fitted = any(score.exposure is not None for score in scores)
    if fitted or spread < _STEADY or explained < _EXPLAINED:
        return []
    return [
        f"The held-out photographs are brighter or darker than the fit by {100 * spread:.0f} % "
        f"(standard deviation), which is {100 * explained:.0f} % of the squared error: exposures "
        "seem to change from one to the next. --refine-exposures fits a gain and an offset of each "
        "photograph."
    ]


def doubt_notes(scores: Sequence[ViewScore]) -> list[str]:
    """A sentence about a fit that is no better than no fit, on photographs held out."""
    found = compared_means(scores, "psnr").means if scores else {}
    if "blend" not in found or found["fit"] > found["blend"]:
        return []
    return [
        f"The fit ({found['fit']:.1f} dB) is no better on held-out photographs than the mean "
        f"of the two nearest training ones ({found['blend']:.1f} dB): it had too few steps or "
        "splats, or poses, intrinsics or masks are not those of the photographs."
    ]


def ramp_notes(settings: FitPhotosSettings, views: int) -> list[str]:
    """A sentence about the ramp, where its exponent was not asked for."""
    asked = settings.training.homogenisation
    if asked.exponent is not None or asked.decided(views).exponent:
        return []
    return [
        f"The ramp that weighs the residual's frequencies was off: with {views} photographs, fewer "
        f"than {ENOUGH_VIEWS}, it was never found to help. --homogenise {USUAL_EXPONENT:g} "
        "turns it on."
    ]


def show_fit(
    page: Page,
    groups: Mapping[str, Sequence[ViewScore]],
    losses: Sequence[tuple[int, float]],
    metrics: Mapping[str, Any],
) -> None:
    """Add to a page: wipes between photographs and fit, errors, scores, the loss."""
    for group, scores in groups.items():
        page.section(f"Pictures: {group}")
        show_views(page, scores, "fit")
    if metrics["scores"]:
        page.section("Scores")
        columns, table, caption = score_table(metrics)
        page.table(columns, table, caption=caption)
    for group, scores in groups.items():
        rows = [_row(score) for score in scores]
        columns = ("picture", "degrees away", "PSNR", "SSIM", "blend PSNR")
        caption = f"{group}: degrees away from the nearest picture that was trained on."
        page.table(columns, rows, caption=caption)
    show_error_places(page, metrics["errors"])
    page.section("Training")
    steps, values = zip(*losses, strict=True)
    draw = partial(curves, {"loss": (steps, values)}, xlabel="step", ylabel="loss")
    figure = figure_svgs(lambda width: draw(width=width))
    page.figure(figure, caption="Of the pictures as they came.", alt="Loss by step")


def _row(score: ViewScore) -> tuple[Any, ...]:
    values = score.values
    blend = values.get("blend_psnr")
    return (score.name, angle_cell(score), values["fit_psnr"], values["fit_ssim"], blend)


def angle_cell(score: ViewScore) -> float | None:
    """Degrees to the nearest training picture, for a table; None where there are none."""
    return score.angle if math.isfinite(score.angle) else None


def show_views(page: Page, scores: Sequence[ViewScore], what: str) -> None:
    """Add wipes between truth and picture, and errors, of the best, middle and worst by PSNR."""
    order = sorted(scores, key=lambda score: -score.values["fit_psnr"])
    cells: list[bytes | Compared] = []
    titles = []
    for place in evenly(len(order), _SHOWN):
        score = order[place]
        error = np.clip(np.abs(score.image - score.truth) * ERROR_GAIN, 0, 1)
        if score.counted is not None:
            error[~score.counted] = 0
        pair = (jpeg(score.truth), jpeg(score.image))
        cells += [Compared(*pair, names=("photograph", what)), jpeg(error)]
        titles += [f"{score.name}, {score.values['fit_psnr']:.1f} dB", "error"]
    page.panels(
        cells,
        titles=titles,
        columns=2,
        caption="The best, the middle and the worst by PSNR. Left of the line the photograph, "
        f"right of it the {what}; draw the line aside. Errors are {ERROR_GAIN:g} times brighter.",
        alt=f"Photograph and {what}",
    )
