"""Figure 6: PSNR and SSIM against the number of projections."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from paper.plan import Plan
from rift_cl import Device
from rift_cl.commands.demo.job import COLUMNS, SCORES, SCORING, study_curves
from rift_cl.commands.demo.view_study import view_study
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png

NAME = "figure_06"
TITLE = "Figure 6: PSNR and SSIM against the number of projections"
COUNTS = (2, 3, 4, 6, 8, 12, 16, 24, 34, 48, 68, 95, 136, 192, 272, 384, 512, 768, 1024)
QUICK_COUNTS = COUNTS[::3]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The scores; a smaller slice and fewer counts in the quick version."""
    size, counts = (512, COUNTS) if plan.full else (256, QUICK_COUNTS)
    scores = view_study(size, counts, device)
    yield {"size": size, "views": [{"count": s.views, **s.scores} for s in scores]}


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the two curves and the table."""
    views = [row["count"] for row in result["views"]]
    for metric, label in (("psnr", "PSNR, dB"), ("ssim", "SSIM")):
        figure = study_curves(views, result["views"], metric, label)
        page.figure(figure_png(figure), caption=SCORING, alt=f"{label} against projections")
    rows = [(row["count"], *(row[key] for key in SCORES)) for row in result["views"]]
    page.table(COLUMNS, rows, caption=SCORING)
