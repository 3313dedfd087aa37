"""Figure 5: a slice from 2, 12, 24, 95 and 512 projections, unfiltered and filtered."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paper.images import decode, encode
from paper.plan import Plan
from rift_cl import Device
from rift_cl.commands.demo.job import COLUMNS, SCORING, study_panels, study_row
from rift_cl.commands.demo.view_study import ViewScore, view_study
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png

NAME = "figure_05"
TITLE = "Figure 5: integration with and without the filter"
COUNTS = (2, 12, 24, 95, 512)
_WINDOW = (0.0, 0.5)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The slices and their scores; a smaller slice in the quick version."""
    size = 512 if plan.full else 256
    yield {"size": size, "views": [_pack(score) for score in view_study(size, COUNTS, device)]}


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the panels and the table."""
    scores = [_unpack(packed) for packed in result["views"]]
    page.paragraph(
        f"The Shepp-Logan phantom on {result['size']} x {result['size']} samples, from its exact "
        "projections. The paper does not say what its target was."
    )
    counts = ", ".join(str(score.views) for score in scores)
    page.figure(
        figure_png(study_panels(scores, size=1.4)),
        caption="Above: backprojection without a filter, after an affine fit. Below: with the "
        "ramp filter.",
        alt=f"Slices from {counts} projections, unfiltered above, filtered below",
    )
    page.table(COLUMNS, [study_row(score) for score in scores], caption=SCORING)


def _pack(score: ViewScore) -> dict[str, Any]:
    images = {name: encode(getattr(score, name), _WINDOW) for name in ("unfiltered", "filtered")}
    return {"count": score.views, "scores": score.scores, **images}


def _unpack(packed: dict[str, Any]) -> ViewScore:
    unfiltered, filtered = (np.asarray(decode(packed[n])) for n in ("unfiltered", "filtered"))
    return ViewScore(packed["count"], unfiltered, filtered, packed["scores"])
