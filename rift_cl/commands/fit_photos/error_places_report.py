"""Tables and curves of where a fit errs, for the reports of ``rift fit`` and ``rift eval``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svgs

_Curve = tuple[list[float], list[float]]

REGION_COLUMNS = ("pictures", "region", "pixels, %", "squared error, %", "PSNR")
BAND_COLUMNS = (
    "pictures", "cycles per pixel", "squared error, %", "error / photograph, dB",
    "picture / photograph",
)  # fmt: skip
_REGIONS = (
    "Where the squared error lies; PSNR in dB of all pixels of a region together. The photographs "
    "alone tell regions: silhouette lies within 2 pixels of the border between foreground "
    "and background; background is not foreground; highlights are at least halfway from the "
    "foreground's median brightness to white; texture varies by more than 5 codes of 255 over 5 x "
    "5 pixels; smooth is the rest. A pixel is in the first of these that fits."
)
_BANDS = (
    "How fine it is: bands of spatial frequency, power of the error and of the picture drawn over "
    "that of the photograph. A picture with less power than the photograph is blurred; one with "
    "about as much and a large error has it in the wrong place."
)
_PLACES = {
    "by_elevation": (
        "elevation of the camera, degrees",
        "Mean PSNR of views within 5 degrees of elevation, as seen from where the cameras look.",
    ),
    "by_distance": (
        "distance to the nearest training camera / distance to the focus",
        "Mean PSNR of views by how far they are from the nearest camera that was trained on.",
    ),
}


def show_error_places(page: Page, errors: Mapping[str, Mapping[str, Any]]) -> None:
    """Add a section about where the pictures of each group err.

    Args:
        page: to add to.
        errors: by group, as ``error_record`` has them.
    """
    if not errors:
        return
    page.section("Where the errors are")
    page.table(REGION_COLUMNS, region_rows(errors), caption=_REGIONS)
    page.table(BAND_COLUMNS, band_rows(errors), caption=_BANDS)
    for kind, (label, caption) in _PLACES.items():
        series = {
            group: ([bin["at"] for bin in found[kind]], [bin["psnr"] for bin in found[kind]])
            for group, found in errors.items()
            if found[kind]
        }
        # A single dot says no more than the mean.
        if any(len(places) > 1 for places, _ in series.values()):
            page.figure(_drawn(series, label), caption=caption, alt=caption)


def _drawn(series: Mapping[str, _Curve], label: str) -> tuple[bytes, bytes]:
    return figure_svgs(lambda width: curves(series, xlabel=label, ylabel="PSNR, dB", width=width))


def region_rows(errors: Mapping[str, Mapping[str, Any]]) -> list[tuple[Any, ...]]:
    """A row under ``REGION_COLUMNS`` for each region of each group."""
    return [
        (group, row["region"], 100 * row["pixels"], 100 * row["error"], row["psnr"])
        for group, found in errors.items()
        for row in found["regions"]
    ]


def band_rows(errors: Mapping[str, Mapping[str, Any]]) -> list[tuple[Any, ...]]:
    """A row under ``BAND_COLUMNS`` for each band of each group."""
    return [
        (
            *(group, f"{row['from']:g} to {row['to']:g}", 100 * row["error"]),
            *(row["relative_error_db"], row["relative_power"]),
        )
        for group, found in errors.items()
        for row in found["bands"]
    ]
