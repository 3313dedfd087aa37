"""The support of real captures: what the photographs at hand sample of their targets.

The paper looks at the finite support of benchmark captures in the Fourier domain (section 3,
Figures 4 and 7). Here every capture beside that of the ornament is measured as it stands: planes of
the Fourier domain, density against frequency, the missing cone and what limits detail. Where a
capture does not say how large its target is, what its pictures show of it counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.images import decode, encode
from paper.plan import Plan
from rift_cl import Device
from rift_cl.commands.analyze.facts import missing, resolution
from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.commands.pictures.coverage_pictures import LEAST, PLANES, near_band, plane_density
from rift_cl.io.captures.capture import capture_name, holds_capture
from rift_cl.report.html_page import Page
from rift_cl.report.plot import FrequencySlice, curves, figure_png, frequency_maps
from rift_cl.sampling import half_sphere, window_width

NAME = "capture_support"
TITLE = "What real captures sample"
# The scale is in views per view of the capture, so that captures of any size share it.
_WINDOW = (1e-3, 1.0)
# Frequencies in cycles per diameter, and directions of each.
_CYCLES, _WAYS = np.geomspace(1.0, 64.0, 37), 1000

Floats = NDArray[np.float64]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {"captures": [str(path) for path in captures_of(plan)]}


def captures_of(plan: Plan) -> list[Path]:
    """The ornament's captures, and those in folders beside its own."""
    if plan.ornament is None:
        return []
    ring, off_path = plan.ornament.ring.absolute(), plan.ornament.off_path.absolute()
    beside = sorted(ring.parent.parent.iterdir()) if plan.full else []
    others = [path for path in beside if path.is_dir() and holds_capture(path)]
    return [ring, off_path, *others]


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Maps, densities, holes and limits of each capture."""
    result = kept or {"captures": []}
    for path in captures_of(plan)[len(result["captures"]) :]:
        result["captures"].append(_measured(path, device))
        yield result


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the table, the maps and the densities."""
    page.paragraph(
        "Density is in views that see a frequency, over all views of the capture. A hole is a cone "
        "of directions of detail that lie on no view's slice, at 8 cycles per diameter. Lengths "
        "are in diameters of the target, which is taken to be what the pictures show of it."
    )
    columns = ("capture", "views", "on no slice", "largest hole", "pixel", "number of views",
               "limited by")  # fmt: skip
    page.table(columns, [_row(entry) for entry in result["captures"]])
    slices = [part for entry in result["captures"] for part in _slices(entry)]
    if not slices:
        return
    page.figure(
        figure_png(
            frequency_maps(
                slices, columns=3, window=_WINDOW, label="share of the views", unit="diameter"
            )
        ),
        caption="Planes of each target's Fourier domain, about its middle. White is what less than "
        "a thousandth of the views see.",
        alt="Maps of density for each capture",
    )
    page.figure(
        figure_png(_densities(result["captures"])),
        caption="Low frequencies are seen by many views, high ones by few: the mean over all "
        "directions falls as 1/k for every capture, until pixels end it.",
        alt="Mean density against frequency for each capture",
    )


def _densities(entries: list[dict[str, Any]]) -> Any:
    series = {entry["name"]: (_CYCLES, np.maximum(entry["mean"], LEAST**2)) for entry in entries}
    law = window_width(1.0) / (2 * _CYCLES)
    return curves(
        {**series, "law 1/k": (_CYCLES, law)},
        xlabel="|k|, cycles per diameter",
        ylabel="share of the views, mean over directions",
        log_x=True,
        log_y=True,
    )


def _measured(path: Path, device: Device) -> dict[str, Any]:
    sampled = open_sampled(AnalyzeSettings(path))
    target, views = sampled.target, sampled.views
    middle = target.center
    hole = next(
        entry for entry in missing(sampled).figures["missing"] if entry["cycles_per_diameter"] == 8
    )
    limit = resolution(sampled, ("middle",)).figures["limits"][0]
    band = near_band(sampled)
    planes = [
        np.log10((plane_density(sampled, middle, plane, band, device) / views).clip(_WINDOW[0] / 2))
        for plane in PLANES
    ]
    return {
        "name": capture_name(path),
        "views": views,
        "hole": hole,
        "limits": {
            key: target.diameter * limit[key] for key in ("pixel", "number_of_views", "reached")
        },
        "limited_by": limit["limited_by"],
        "band": band * target.diameter,
        "planes": [encode(plane.astype(np.float32), _logarithms()) for plane in planes],
        "mean": _mean(sampled, device).tolist(),
    }


def _logarithms() -> tuple[float, float]:
    return float(np.log10(_WINDOW[0] / 2)), float(np.log10(_WINDOW[1]))


def _mean(sampled: ViewSet, device: Device) -> Floats:
    """The mean over directions, as a share of the views."""
    k = (_CYCLES[:, None, None] / sampled.target.diameter * half_sphere(_WAYS)).reshape(-1, 3)
    found = sampled.coverage(k, device, points=sampled.target.center[None])[0]
    return np.asarray(found.reshape(_CYCLES.size, _WAYS).mean(axis=1) / sampled.views)


def _row(entry: dict[str, Any]) -> tuple[object, ...]:
    hole, limits = entry["hole"], entry["limits"]
    axis = "({:.2f}, {:.2f}, {:.2f})".format(*hole["axis"])
    return (
        entry["name"],
        entry["views"],
        f"{hole['share']:.1%}",
        f"{hole['half_angle_degrees']:.3g}° about {axis}",
        f"{1 / limits['pixel']:.3g}",
        f"{1 / limits['number_of_views']:.3g}",
        entry["limited_by"],
    )


def _slices(entry: dict[str, Any]) -> list[FrequencySlice]:
    return [
        FrequencySlice(
            10.0 ** decode(packed),
            entry["band"],
            (f"k{'xyz'[a]}", f"k{'xyz'[b]}"),
            f"{entry['name']}, {entry['views']} views" if (a, b) == PLANES[1] else "",
        )
        for packed, (a, b) in zip(entry["planes"], PLANES, strict=True)
    ]
