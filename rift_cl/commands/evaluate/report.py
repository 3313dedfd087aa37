"""The report of ``rift eval``: scores, and the best and worst views beside the photographs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rift_cl.commands.fit_photos.error_places_report import show_error_places
from rift_cl.commands.fit_photos.report import SCORES, angle_cell, score_table, show_views
from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.report.html_page import Page

_TRAINED = ("degrees away", "nearest PSNR", "blend PSNR")


def eval_page(
    name: str,
    groups: Mapping[str, Sequence[ViewScore]],
    metrics: Mapping[str, Any],
    notes: Sequence[str],
) -> Page:
    """The report of a finished evaluation, with sentences about how it was scored."""
    page = Page(f"Scores of {name}", f"{metrics['splats']} splats, eps2d {metrics['eps2d']:g}")
    for group, scores in groups.items():
        page.section(f"Pictures: {group}")
        show_views(page, scores, "scene")
    page.section("Scores")
    columns, rows, caption = score_table(metrics)
    page.table(columns, rows, caption=caption)
    for note in notes:
        page.paragraph(note)
    for group, scores in groups.items():
        trained = any("nearest_psnr" in score.values for score in scores)
        kinds = [kind for kind in SCORES if any(f"fit_{kind}" in s.values for s in scores)]
        columns = ["picture", *(SCORES[kind] for kind in kinds), *(_TRAINED if trained else ())]
        page.table(columns, [_row(score, kinds, trained) for score in scores], caption=group)
    show_error_places(page, metrics["errors"])
    return page


def _row(score: ViewScore, kinds: Sequence[str], trained: bool) -> tuple[Any, ...]:
    values = score.values
    cells = (score.name, *(values.get(f"fit_{kind}") for kind in kinds))
    if not trained:
        return cells
    return (*cells, angle_cell(score), values.get("nearest_psnr"), values.get("blend_psnr"))
