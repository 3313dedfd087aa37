"""Figure 11, regression: PSNR and SSIM of fitted splats against the number of input views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from paper.fits import FIXED, HELD_OUT, OFF_PATH, SETS, Fitted, fitted
from paper.plan import Plan
from rift_cl import Device
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_png

NAME = "figure_11"
TITLE = "Figure 11, regression: PSNR and SSIM against the number of input views"

_KINDS = {"psnr": "PSNR, dB", "psnr_foreground": "PSNR foreground, dB", "ssim": "SSIM"}
_METHODS = {"fit": "splats", "blend": "blend of two", "nearest": "nearest view"}
_SHORT = {HELD_OUT: "paper's split", FIXED: "fixed, on the ring", OFF_PATH: "fixed, off the ring"}
_REGRESSION = (
    "Splats fitted to the ornament, a path-traced stand-in for the paper's photographs, which are "
    "not published: the numbers are no reproduction of the paper's, the trends can be compared. "
    "Each number of views is taken evenly along the ring, and one fit serves three test sets. By "
    "the paper's split every 8th of the chosen views is held out: with more views the pictures "
    "that are scored come ever nearer to their neighbours, so that points of one curve are scored "
    "on different tasks. The fixed sets are the same at every number of views: every 8th view of "
    "the whole ring, and views off the ring. A view that should be trained on but is in the fixed "
    "set gives way to the next one along the ring."
)
_MEANS = (
    "Means over the pictures, in display light, PSNR with peak 1. The foreground is what differs "
    "from the background by more than two codes. 'nearest' and 'blend' are the nearest picture "
    "that was trained on and the mean of the two nearest: what no fit at all scores."
)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {**plan.size(), **plan.fits(), "seed": plan.seeds[0]}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The scores of one number of views after the other."""
    earlier = {row["count"]: row for row in kept.get("regression", [])}
    rows: list[dict[str, Any]] = []
    for count in plan.counts:
        rows.append(earlier.get(count) or _row(fitted(plan, count)))
        yield {"regression": rows}


def _row(fit: Fitted) -> dict[str, Any]:
    """The scores of a fit."""
    sets = {}
    for name in SETS:
        angles = [view["angle"] for view in fit.views(name)]
        mean = sum(angles) / len(angles)
        sets[name] = {"pictures": len(angles), "degrees": mean, **fit.scores(name)}
    return {"count": fit.count, "splats": fit.metrics["splats"], "sets": sets}


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the curves and the tables."""
    rows = result["regression"]
    page.paragraph(_REGRESSION)
    for kind, label in _KINDS.items():
        series = {_SHORT[name]: _points(rows, name, f"fit_{kind}") for name in SETS}
        _draw(page, series, label, "Splats on three test sets.")
    for name, words in SETS.items():
        # The foreground's PSNR lies below that of the whole picture by nearly the same everywhere.
        for kind in ("psnr", "ssim"):
            series = {m: _points(rows, name, f"{key}_{kind}") for key, m in _METHODS.items()}
            _draw(page, series, _KINDS[kind], f"Splats beside no fit at all: {words}.")
    _tables(page, rows)


def _points(rows: Sequence[dict[str, Any]], name: str, key: str) -> tuple[list[int], list[float]]:
    """A score of a test set against the number of views, where there is one."""
    found = [(row["count"], row["sets"][name].get(key)) for row in rows]
    kept = [(count, value) for count, value in found if value is not None]
    return [count for count, _ in kept], [value for _, value in kept]


def _draw(page: Page, series: dict[str, Any], label: str, caption: str) -> None:
    there = {name: points for name, points in series.items() if points[0]}
    if there:
        figure = curves(there, xlabel="number of input views", ylabel=label, log_x=True)
        page.figure(figure_png(figure), caption=caption, alt=caption)


def _tables(page: Page, rows: Sequence[dict[str, Any]]) -> None:
    facts = []
    for row in rows:
        sets = row["sets"]
        trained = row["count"] - sets[HELD_OUT]["pictures"]
        for name in SETS:
            cells = (sets[name]["pictures"], sets[name]["degrees"])
            facts.append((row["count"], trained, _SHORT[name], *cells))
    columns = ("views", "trained on", "test set", "pictures", "degrees away")
    page.table(columns, facts, caption="Away from the nearest picture that was trained on, mean.")
    for name, words in SETS.items():
        cells = [
            (row["count"], label, *(row["sets"][name].get(f"{m}_{kind}") for m in _METHODS))
            for row in rows
            for kind, label in _KINDS.items()
        ]
        page.table(("views", "score", *_METHODS.values()), cells, caption=f"{words}. {_MEANS}")
