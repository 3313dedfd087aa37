"""The report of ``rift analyze``: figures first, then the plots behind them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rift_cl.cl.device import Device
from rift_cl.commands.analyze.facts import Findings
from rift_cl.commands.inputs.view_set import Floats, ViewSet, place_of
from rift_cl.commands.pictures.coverage_pictures import (
    add_coverage,
    add_missed_planes,
    camera_figure,
    direction_figure,
)
from rift_cl.geometry import Camera
from rift_cl.geometry.seen_grid import seen_grid
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_svg

_HEADINGS = ("Missing directions", "Resolution limits", "Views to add")


def analysis_page(
    sampled: ViewSet,
    points: Mapping[str, Floats],
    findings: Sequence[Findings],
    metrics: Mapping[str, Any],
    added: Sequence[Camera],
    device: Device,
) -> Page:
    """The report of a finished analysis."""
    target = sampled.target
    page = Page(f"Sampling of {sampled.name}", findings[0].sentences[0])
    page.facts(
        {
            **sampled.facts,
            "views that see the target's centre": metrics["views_of_center"],
            "target": f"{target.diameter:.4g} {sampled.units} about {place_of(target)}",
            **_unknown(sampled, metrics["unknown"]),
        }
    )
    for note in sampled.notes:
        page.paragraph(note)
    _views(page, sampled, added, device)
    for heading, found in zip(_HEADINGS, findings, strict=True):
        if not found.sentences:
            continue
        page.section(heading)
        for sentence in found.sentences:
            page.paragraph(sentence)
        for columns, rows, caption in found.tables:
            page.table(columns, rows, caption=caption)
    if sampled.orbit is not None:
        add_missed_planes(page, sampled.orbit, seen_grid(sampled.orbit), unit=sampled.units)
    if not sampled.opaque:
        page.section("Coverage")
        add_coverage(page, sampled, points, device)
    return page


def _unknown(sampled: ViewSet, value: float) -> dict[str, str]:
    if sampled.opaque:
        return {}
    target = sampled.target
    return {
        "posterior variance": f"{value:.3%} of the prior, for a power spectrum 1/k^2 up to "
        f"{target.highest:.3g} cycles per {sampled.unit}"
    }


def _views(page: Page, sampled: ViewSet, added: Sequence[Camera], device: Device) -> None:
    if sampled.cameras:
        page.section("Camera poses")
        groups = {"at hand": sampled.cameras, "to add": tuple(added)}
        page.figure(
            figure_svg(camera_figure(groups, sampled)),
            caption="The grey disc is the target; lines show the viewing directions.",
            alt="Cameras from above and from the side",
        )
    if sampled.is_flat:
        return
    page.section("Directions")
    page.figure(
        figure_svg(direction_figure(sampled, device, added)),
        caption="The upper hemisphere, seen from above; opposite directions count as one, so "
        "that a view from below is shown above. Left: lines of sight. Right: how many views "
        "sample detail along each direction, at 8 cycles per diameter; hatched directions lie on "
        "no view's slice.",
        alt="Hemispheres of lines of sight and of directions of detail",
    )
