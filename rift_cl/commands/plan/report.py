"""The report of ``rift plan``: camera poses, coverage, and what each view adds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.commands.pictures.coverage_pictures import (
    add_coverage,
    camera_figure,
    direction_figure,
)
from rift_cl.commands.plan.input import PlanInput
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svg
from rift_cl.sampling.planning.view_plan import DiminishingReturns, Plan
from rift_cl.sampling.targets.scattered import ACCURACY

# The criterion that is minimized, for people.
_CRITERIA = {
    "wiener": "posterior variance (A-optimal)",
    "logdet": "negative information, bits per frequency (D-optimal)",
    "worst": "posterior variance, worst direction (E-optimal)",
}
_NAMES = {
    "ring": "a ring",
    "arc": "a single arc",
    "fibonacci": "evenly spread",
    "zigzag": "a zigzag",
    "quantiles": "by the square root of the power",
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
    page.section("Comparison with other arrangements")
    page.table(*worth_table(metrics), caption=caption_of(metrics))
    page.paragraph(metrics["verdict"])
    page.paragraph(bound_words(metrics))
    _assumed(page, given)
    _gains(page, found, diminishing_returns, criterion_name(metrics))
    _coverage(page, sampled, device)
    return page


def criterion_name(metrics: Mapping[str, Any]) -> str:
    """The criterion, for people."""
    kind = metrics["criterion"]
    if metrics["mode"] == "surface" and kind != "logdet":
        return "posterior variance of texture and appearance, added"
    return _CRITERIA[kind]


def worth_table(metrics: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Columns and rows: the criterion of the plan and of common arrangements of as many views."""
    own, kind = metrics["value"], metrics["criterion"]
    columns = (
        "views",
        criterion_name(metrics),
        "gain of the plan",
    )
    rows: list[tuple[Any, ...]] = [("planned", _shown(own, kind), "")]
    # A surface's criterion is not summed over scattered frequencies.
    told = ACCURACY[kind] if metrics["mode"] == "volume" else 0.0
    for name, value in metrics["baselines"].items():
        rows.append((_NAMES.get(name, name), _shown(value, kind), _against(value, own, told)))
    return columns, rows


def caption_of(metrics: Mapping[str, Any]) -> str:
    """The caption of the table of baselines."""
    views, wanted = metrics["views"], metrics["wanted"]
    paid = f" (the budget does not allow the {wanted} asked for)" if views < wanted else ""
    noun = "view" if views == 1 else "views"
    return (
        f"{views} {noun} each{paid}, under the same constraints, with the best cameras and "
        "settings. Lower is better."
    )


def _shown(value: float, kind: str) -> str:
    return f"{value:.4g}" if kind == "logdet" else f"{100 * value:.3g}%"


def bound_words(metrics: Mapping[str, Any]) -> str:
    """How far from the optimum the plan may be."""
    kind, own = metrics["criterion"], metrics["planned_with"]
    # The bound of a surface may be too weak to be of use.
    if kind != "logdet" and own["bound"] <= 0:
        return "The distance to the optimum is not known."
    return (
        f"At the frequencies used for planning the criterion is {_shown(own['value'], kind)}; no "
        f"choice of as many views among the candidates and these can be below "
        f"{_shown(own['bound'], kind)}."
    )


def _against(value: float, own: float, told: float) -> str:
    """By which fraction the plan is below a value (``Plan.gain``), if by more than is told."""
    gain = (value - own) / max(abs(value), 1e-300)
    return f"none above {told:.1%}" if abs(gain) < told else f"{gain:.1%}"


def _assumed(page: Page, given: PlanInput) -> None:
    page.section("Assumptions")
    for note in given.notes:
        page.paragraph(note)
    low, high = (math.degrees(angle) for angle in given.constraints.elevation)
    first, last = (math.degrees(angle) for angle in given.constraints.azimuth)
    page.facts(
        {
            "target": f"{given.target.diameter:.4g} mm in diameter, {given.target.mode}",
            "highest frequency of interest": f"{given.target.highest:.4g} cycles per mm",
            "signal-to-noise ratio": f"{given.target.snr:g} for one view at one cycle per diameter",
            "elevation": f"{low:g} to {high:g} degrees",
            "azimuth": f"{first:g} to {last:g} degrees",
            "path": type(given.constraints.path).__name__.lower(),
            "regions kept out": len(given.constraints.keepouts),
        }
    )


def _cameras(page: Page, given: PlanInput, found: Plan, sampled: ViewSet) -> None:
    page.section("Camera poses")
    groups = {"taken already": found.fixed, "planned": found.cameras}
    page.figure(
        figure_svg(camera_figure(groups, sampled)),
        caption="The grey disc is the target; lines show the viewing directions. views.csv lists "
        "angles, distances and settings, the most informative view first, so that its first rows "
        "are a good plan of fewer views.",
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
    page.section("Gain of each view")
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
        caption="The criterion as views are added, the most informative first.",
        alt="Criterion against the number of views",
    )
    average = "of the average gain of those before it"
    share = f"{diminishing_returns.share:.0%}"
    page.paragraph(
        f"Every view still gains more than {share} {average}: more views would help."
        if diminishing_returns.views is None
        else f"After {diminishing_returns.views} views the returns diminish: the next gains less "
        f"than {share} {average}."
    )


def _coverage(page: Page, sampled: ViewSet, device: Device) -> None:
    page.section("Coverage")
    page.figure(
        figure_svg(direction_figure(sampled, device)),
        caption="Left: lines of sight on the upper hemisphere, seen from above; opposite ones "
        "count as one. Right: how many views sample detail along each direction, at 8 cycles "
        "per diameter; hatched directions lie on no view's slice.",
        alt="Hemispheres of lines of sight and of directions of detail",
    )
    points = sampled.named_points
    add_coverage(page, sampled, points, device)
