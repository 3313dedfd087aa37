"""What planned views are worth: in a sector, for a known spectrum, for lenses of several lengths.

Not a figure of the paper; it bears out the claims of the planner, and where there is nothing to
claim. Views are planned with what would be known before: the mean spectrum of other objects, or a
first reconstruction from few views. Every set of views is then scored by reconstructions.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paper.plan import Plan
from paper.planned_array import ARRAYS, DISTANCE, array_case, ball
from paper.planned_array import VIEWS as ARRAY_VIEWS
from paper.planned_flat import METHODS, PILOT, flat_case
from paper.planned_sector import ARCS, SIZE, TWICE, VIEWS, arc_name, directions, volume_case
from rift_cl import Device
from rift_cl.report.html_page import Page
from rift_cl.report.plot import Stands, camera_plot, figure_png

NAME = "planned_views"
TITLE = "Planned views against what is done without a plan"
# In a sector, dB above the best arc and above the middle arc of twice as many views; where nothing
# is to be gained, dB that the plan and even views may be apart.
OVER_ARC, OVER_TWICE, APART = 0.4, 1.0, 0.5


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {**plan.size(), **_extent(plan)}


def _extent(plan: Plan) -> dict[str, Any]:
    if plan.full:
        return {"objects": 8, "rotations": 4, "volumes": 6, "draws": 3}
    return {"objects": 2, "rotations": 1, "volumes": 2, "draws": 1}


def _cases(plan: Plan) -> list[tuple[str, str, int]]:
    """Flat kinds and counts, volumes, arrays."""
    flat = [("anisotropic", 12), ("isotropic", 12)]
    if plan.full:
        flat += [("anisotropic", 24), ("isotropic", 24)]
    return [
        *(("flat", kind, views) for kind, views in flat),
        *(("volume", name, 0) for name in ("sector", "free")),
        *(("array", name, 0) for name in ARRAYS),
    ]


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """One case after another."""
    result = kept or {"flat": [], "volume": [], "array": []}
    extent, done = _extent(plan), sum(map(len, result.values()))
    for part, name, views in _cases(plan)[done:]:
        if part == "flat":
            case = flat_case(name, views, extent["objects"], extent["rotations"], device)
        elif part == "volume":
            case = volume_case(name, extent["volumes"], extent["draws"])
        else:
            case = array_case(name)
        result[part].append(case)
        yield result


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw tables of PSNR, what the planner says, and where cameras stand."""
    page.paragraph(
        "PSNR in dB, peak 1, in the disc or ball that holds the object. The planner is told the "
        "mean spectrum of other objects of the same kind, or what a reconstruction from the "
        "first few views shows (pilot). 'As wanted' are the claims that stand in this table."
    )
    for case in result["flat"]:
        _show_flat(page, case)
    for case in result["volume"]:
        _show_volume(page, case)
    if result["array"]:
        _show_array(page, result["array"])


def _show_flat(page: Page, case: dict[str, Any]) -> None:
    rows = [
        (name, *(f"{scores[method]:.2f}" for method in METHODS))
        for name, scores in case["psnr"].items()
    ]
    wanted = ", ".join(f"{m} {'yes' if flat_passes(case, m) else 'no'}" for m in METHODS)
    claim = (
        f"planned {case['views']} above even {2 * case['views']}"
        if case["kind"] == "anisotropic"
        else f"planned and even within {APART:g} dB"
    )
    page.table(
        ("directions", *METHODS),
        rows,
        caption=f"Flat {case['kind']} objects, {case['views']} views. As wanted ({claim}): "
        f"{wanted}. The planner says: {case['verdict']}",
    )


def flat_passes(case: dict[str, Any], method: str) -> bool:
    """Whether a flat case bears out its claim."""
    views, scores = case["views"], case["psnr"]
    planned = scores[f"planned {views}"][method]
    if case["kind"] == "anisotropic":
        return bool(planned > scores[f"even {2 * views}"][method])
    return bool(abs(planned - scores[f"even {views}"][method]) <= APART)


def pilot_gain(case: dict[str, Any], method: str) -> float:
    """Gain in dB of views planned after a first look over as many even ones."""
    views, scores = case["views"], case["psnr"]
    piloted = scores[f"planned {views}, pilot of {PILOT[views]}"][method]
    return float(piloted - scores[f"even {views}"][method])


def _show_volume(page: Page, case: dict[str, Any]) -> None:
    rows = [(name, f"{value:.2f}") for name, value in case["psnr"].items()]
    claim = (
        f"{OVER_ARC:g} dB above the best arc, {OVER_TWICE:g} dB above {2 * VIEWS} views on the "
        "middle one"
        if case["name"] == "sector"
        else f"planned and Fibonacci within {APART:g} dB"
    )
    where = "a sector of 120 degrees, elevations 0 to 60" if case["name"] == "sector" else "free"
    page.table(
        ("directions", "PSNR, dB"),
        rows,
        caption=f"Volumes of {SIZE} x {SIZE} x {SIZE} samples, {VIEWS} views, {where}; best "
        f"linear estimate. As wanted ({claim}): {'yes' if volume_passes(case) else 'no'}. The "
        f"planner says: {case['verdict']}",
    )
    if case["name"] == "sector":
        stands = _stands(case["azimuth"], case["elevation"], 1.0)
        figure = camera_plot(
            {"planned": stands}, center=(0, 0, 0), diameter=0.4, up=(0, 0, 1), unit="radii"
        )
        page.figure(
            figure_png(figure),
            caption="The planned directions of the sector: most on its rim, some taken twice.",
            alt="Cameras round a ball, from above and from the side",
        )


def volume_passes(case: dict[str, Any]) -> bool:
    """Whether a case of volumes bears out its claim."""
    psnr = case["psnr"]
    if case["name"] == "sector":
        best = max(psnr[arc_name(elevation)] for elevation in ARCS)
        over = psnr["planned"] >= best + OVER_ARC
        return bool(over and psnr["planned"] >= psnr[TWICE] + OVER_TWICE)
    return bool(abs(psnr["planned"] - psnr["Fibonacci"]) <= APART)


def array_passes(cases: list[dict[str, Any]]) -> bool:
    """Whether lenses of two lengths together know more than as many of either."""
    merits = {case["array"]: case["merit"] for case in cases}
    mixed = merits.pop("wide and long", np.inf)
    return bool(merits) and mixed < min(merits.values())


def _show_array(page: Page, cases: list[dict[str, Any]]) -> None:
    rows = [
        (case["array"], *(case["types"].count(n) for n in ("wide", "long")), f"{case['merit']:.3f}")
        for case in cases
    ]
    wanted = "yes" if array_passes(cases) else "no"
    page.table(
        ("array", "wide", "long", "stays unknown"),
        rows,
        caption=f"{ARRAY_VIEWS} cameras round an opaque textured ball, as planned: what stays "
        "unknown of its texture and of how its brightness changes with direction (1 each at "
        f"first). As wanted (both together below either alone): {wanted}.",
    )
    case = cases[-1]
    groups = {}
    for name in ("wide", "long"):
        chosen = [kind == name for kind in case["types"]]
        azimuth, elevation = (np.array(case[key])[chosen] for key in ("azimuth", "elevation"))
        if len(azimuth):
            groups[name] = _stands(azimuth, elevation, DISTANCE)
    target = ball()
    figure = camera_plot(
        groups, center=(0, 0, 0), diameter=target.diameter, up=(0, 0, 1), unit="mm"
    )
    page.figure(
        figure_png(figure),
        caption=f"Where the cameras of the array '{case['array']}' stand.",
        alt="Cameras round a ball, from above and from the side",
    )


def _stands(azimuth: Any, elevation: Any, distance: float) -> Stands:
    outward = directions(np.asarray(azimuth), np.asarray(elevation))
    return Stands(distance * outward, -outward)
