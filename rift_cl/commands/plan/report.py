"""What ``rift plan`` shows: where the cameras stand, what they sample, what each brings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.view_set import ViewSet, points_of
from rift_cl.commands.pictures.coverage_pictures import (
    add_coverage,
    camera_figure,
    direction_figure,
)
from rift_cl.commands.plan.input import PlanInput
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svg
from rift_cl.sampling.planning.view_plan import DiminishingReturns, Plan

# What a merit is, for people.
_MERITS = {
    "wiener": "power that stays unknown",
    "logdet": "bits per frequency, less than none",
    "worst": "power that stays unknown, worst direction",
}
_NAMES = {
    "ring": "a ring",
    "arc": "a single arc",
    "fibonacci": "evenly spread",
    "zigzag": "a zigzag",
    "quantiles": "by the root of the power",
    "random": "random",
}


def plan_page(
    given: PlanInput,
    found: Plan,
    diminishing_returns: DiminishingReturns,
    sampled: ViewSet,
    metrics: Mapping[str, Any],
    device: Device,
) -> Page:
    """The report of a finished plan."""
    more = f" besides {len(found.fixed)} taken" if found.fixed else ""
    noun = "view" if len(found) == 1 else "views"
    page = Page(f"Plan of {len(found)} {noun}{more}", metrics["verdict"])
    _cameras(page, given, found, sampled)
    page.section("What planning is worth")
    page.table(*worth_table(metrics), caption=caption_of(metrics))
    page.paragraph(metrics["verdict"])
    page.paragraph(bound_words(metrics))
    _assumed(page, given)
    _gains(page, found, diminishing_returns, merit_name(metrics))
    _coverage(page, sampled, device)
    return page


def merit_name(metrics: Mapping[str, Any]) -> str:
    """What the merit is, for people."""
    kind = metrics["kind"]
    if metrics["mode"] == "surface" and kind != "logdet":
        return "unknown share of texture and appearance, added"
    return _MERITS[kind]


def worth_table(metrics: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Columns and rows: the merit of the plan, and of what people do without one."""
    own, kind = metrics["merit"], metrics["kind"]
    columns = (
        "views",
        merit_name(metrics),
        "more when planned" if kind == "logdet" else "less when planned",
    )
    rows: list[tuple[Any, ...]] = [("planned", _shown(own, kind), "")]
    for name, value in metrics["baselines"].items():
        rows.append((_NAMES.get(name, name), _shown(value, kind), _against(value, own)))
    return columns, rows


def caption_of(metrics: Mapping[str, Any]) -> str:
    """What the table of worth compares."""
    views, wanted = metrics["views"], metrics["wanted"]
    paid = f" (the budget ends before the {wanted} that were wanted)" if views < wanted else ""
    noun = "view" if views == 1 else "views"
    return (
        f"{views} {noun} each{paid}, under the same constraints, with the cameras and settings "
        "that do best. Lower is better."
    )


def _shown(value: float, kind: str) -> str:
    return f"{value:.4g}" if kind == "logdet" else f"{100 * value:.3g}%"


def bound_words(metrics: Mapping[str, Any]) -> str:
    """How much a better choice could bring at the most."""
    kind, own = metrics["kind"], metrics["planned_with"]
    # A surface's bound may be too weak to say anything.
    if kind != "logdet" and own["bound"] <= 0:
        return "How much better another choice could be is not known."
    return (
        f"At the frequencies that it was planned with, the plan comes to "
        f"{_shown(own['merit'], kind)}; no choice of as many views among the candidates and these "
        f"gets below {_shown(own['bound'], kind)} there."
    )


def _against(value: float, own: float) -> str:
    """By which share the plan is below a value, as ``Plan.gain`` has it."""
    return f"{(value - own) / max(abs(value), 1e-300):.1%}"


def _assumed(page: Page, given: PlanInput) -> None:
    page.section("What was assumed")
    for note in given.notes:
        page.paragraph(note)
    low, high = (math.degrees(angle) for angle in given.constraints.elevation)
    first, last = (math.degrees(angle) for angle in given.constraints.azimuth)
    page.facts(
        {
            "target": f"{given.target.diameter:.4g} mm across, {given.target.mode}",
            "finest frequency wanted": f"{given.target.highest:.4g} cycles per mm",
            "signal to noise": f"{given.target.snr:g} for one view at one cycle per diameter",
            "elevation": f"{low:g} to {high:g} degrees",
            "azimuth": f"{first:g} to {last:g} degrees",
            "path": type(given.constraints.path).__name__.lower(),
            "places kept out": len(given.constraints.keepouts),
        }
    )


def _cameras(page: Page, given: PlanInput, found: Plan, sampled: ViewSet) -> None:
    page.section("Where the cameras stand")
    groups = {"taken already": found.fixed, "planned": found.cameras}
    page.figure(
        figure_svg(camera_figure(groups, sampled)),
        caption="The target is the grey disc; lines point where the cameras look. views.csv has "
        "the angles, distances and settings, the most useful view first, so that the first views "
        "of the list are themselves a good plan of fewer.",
        alt=f"{len(found)} planned cameras from above and from the side",
    )
    rows = []
    for kind in given.types:
        own = [k for k, t in enumerate(found.types) if t.name == kind.name]
        if own:
            distance = found.distance[own]
            rows.append((kind.name, len(own), _range(distance), _range(found.focus[own])))
    page.table(("camera", "views", "distance, mm", "focus, mm"), rows)


def _range(values: Any) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:.4g}" if high - low < 1e-3 * high else f"{low:.4g} to {high:.4g}"


def _gains(page: Page, found: Plan, diminishing_returns: DiminishingReturns, name: str) -> None:
    page.section("What each view brings")
    views = np.arange(len(diminishing_returns.merits)) + len(found.fixed)
    figure = curves(
        {"planned": (views, diminishing_returns.merits)},
        xlabel="views",
        ylabel=name,
        mark=None
        if diminishing_returns.views is None
        else float(diminishing_returns.views + len(found.fixed)),
    )
    page.figure(
        figure_svg(figure),
        caption="The merit as views are added, the most useful first.",
        alt="Merit against the number of views",
    )
    average = "of what those before it brought on average"
    share = f"{diminishing_returns.share:.0%}"
    page.paragraph(
        f"Every view still brings more than {share} {average}: more would help."
        if diminishing_returns.views is None
        else f"After {diminishing_returns.views} views the returns diminish: the next brings less "
        f"than {share} {average}."
    )


def _coverage(page: Page, sampled: ViewSet, device: Device) -> None:
    target = sampled.target
    page.section("What the views sample")
    page.figure(
        figure_svg(direction_figure(sampled, device)),
        caption="Left, lines of sight on the upper hemisphere, up in the middle; opposite ones "
        "count as one. Right, how many views see detail along each direction, at 8 cycles per "
        "diameter; hatched is what lies on no view's slice.",
        alt="Hemispheres of lines of sight and of directions of detail",
    )
    points = points_of(target.center, target.diameter, sampled.up, flat=sampled.is_flat)
    add_coverage(page, sampled, points, device)
