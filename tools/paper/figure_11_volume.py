"""Figure 11, integration: a volume from projections and from radial k-space samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.images import decode, encode
from paper.plan import Plan
from paper.radial_kspace import measure
from rift_cl import Device, Grid, Parallel, Projector
from rift_cl.commands.demo.job import COLUMNS, SCORES, study_curves
from rift_cl.commands.demo.view_study import ViewScore, detector_bins, score_views
from rift_cl.phantom import head, project, shepp_logan
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png, image_grid

NAME = "figure_11_volume"
TITLE = "Figure 11, integration: a volume from projections over pi"
COUNTS = (10, 64, 250, 570)

_SIZES = {True: 256, False: 64}
_WINDOW = (0.0, 0.5)
_Volume = NDArray[np.float32]
_INPUTS: dict[str, Callable[[Any, Grid, Parallel], _Volume]] = {
    "projections": project,
    "radial k-space": measure,
}
_SCORING = (
    "Whole volume, corners included: PSNR in dB with peak 1, SSIM with a three-dimensional window. "
    "Unfiltered volumes are scored after the gain and offset that serve them best."
)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Scores and cuts of one number of views after the other, from both kinds of input."""
    size = _SIZES[plan.full]
    grid = Grid((size,) * 3)
    truth = shepp_logan(grid)
    rows: list[dict[str, Any]] = list(kept.get("views", []))
    done = {(row["input"], row["count"]) for row in rows}
    for name, scanned in _INPUTS.items():
        for count in COUNTS:
            if (name, count) in done:
                continue
            scan = Parallel(np.arange(count) * np.pi / count, detector_bins(size))
            A = Projector(grid, scan, device=device)
            found = score_views(A, scanned(head(grid), grid, scan), truth)
            rows.append({"input": name, **_packed(found)})
            yield {"size": size, "truth": _cuts(truth), "views": rows}


def _packed(score: ViewScore) -> dict[str, Any]:
    cuts = {name: _cuts(getattr(score, name)) for name in ("unfiltered", "filtered")}
    return {"count": score.views, **score.scores, **cuts}


def _cuts(volume: _Volume) -> list[dict[str, Any]]:
    """The middle planes across z and across y."""
    middle = len(volume) // 2
    return [encode(volume[middle], _WINDOW), encode(volume[:, middle], _WINDOW)]


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the cuts, the curves and the table of each kind of input."""
    size = result["size"]
    page.paragraph(
        f"The three-dimensional Shepp-Logan head on {size} x {size} x {size} voxels. The paper "
        "simulated magnetic resonance projections of a target that it does not describe, so the "
        "trends can be compared, not the numbers. Projections are exact line integrals; radial "
        "k-space is the head's exact spectrum on radial lines in every plane kz, whose inverse "
        "transform gives band-limited projections."
    )
    for name in dict.fromkeys(row["input"] for row in result["views"]):
        rows = [row for row in result["views"] if row["input"] == name]
        _show_cuts(page, name, rows)
        for metric, label in (("psnr", "PSNR, dB"), ("ssim", "SSIM")):
            figure = study_curves([row["count"] for row in rows], rows, metric, label)
            page.figure(figure_png(figure), caption=f"From {name}. {_SCORING}", alt=label)
        cells = [(row["count"], *(row[key] for key in SCORES)) for row in rows]
        page.table(COLUMNS, cells, caption=f"From {name}. {_SCORING}")


def _show_cuts(page: Page, name: str, rows: Sequence[dict[str, Any]]) -> None:
    images, labels = [], []
    for method in ("unfiltered", "filtered"):
        for place, cut in enumerate(("across z", "across y")):
            images += [np.asarray(decode(row[method][place])) for row in rows]
            labels.append(f"{method}, {cut}")
    titles = [f"{row['count']} views" for row in rows]
    figure = image_grid(
        images,
        titles=titles + [""] * (len(images) - len(rows)),
        columns=len(rows),
        window=_WINDOW,
        row_labels=labels,
    )
    caption = f"From {name}: the volume's middle planes."
    page.figure(figure_png(figure), caption=caption, alt=caption)
