"""``rift demo``: the main job on a phantom, so that a new user sees it work in a minute."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rift_cl.cl.discovery import open_device
from rift_cl.errors import InputError
from rift_cl.html_page import Page
from rift_cl.io.image import write_png
from rift_cl.jobs.run_folder import RunFolder
from rift_cl.jobs.view_study import ViewScore, view_study
from rift_cl.plot import curves, figure_png, image_grid
from rift_cl.progress import Report

COLUMNS = ("views", "PSNR unfiltered", "SSIM unfiltered", "PSNR filtered", "SSIM filtered")
# SSIM looks at windows of 11 samples.
_SMALLEST = 11
SCORES = ("psnr_unfiltered", "ssim_unfiltered", "psnr_filtered", "ssim_filtered")

SCORING = (
    "PSNR in dB (peak 1) and SSIM, inside the inscribed disc. Unfiltered slices are scored after "
    "an affine fit to the phantom (gain and offset), filtered ones as they are."
)


@dataclass(frozen=True)
class DemoSettings:
    """Reconstruct a phantom, unfiltered and filtered, from few views and from many.

    Example: rift demo --size 256 --views 8 32 128
    """

    out: Path = Path("rift-demo")
    """Folder for the pictures, report.html, config.json and metrics.json."""
    size: int = 512
    """Samples along each side of the slice."""
    views: tuple[int, ...] = (2, 12, 24, 95, 512)
    """Numbers of views; the default is that of the paper's Figure 5."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""


class DemoJob:
    """A demonstration that is planned; nothing is written yet.

    Args:
        settings: what to do.
    """

    def __init__(self, settings: DemoSettings) -> None:
        self.settings = settings
        if settings.size < _SMALLEST:
            raise InputError(f"--size is {settings.size}, wanted {_SMALLEST} or more")
        if not settings.views or min(settings.views) < 1:
            raise InputError(f"--views is {settings.views}, wanted one number or more, each >= 1")
        self.device = open_device(settings.device)
        self.folder = RunFolder(settings.out, "demo", overwrite=True)
        self.rows: list[tuple[float, ...]] = []

    def run(self) -> Iterator[Report]:
        """Do it; a report after every number of views."""
        counts = self.settings.views
        scores = []
        for score in view_study(self.settings.size, counts, self.device):
            scores.append(score)
            self.rows.append(study_row(score))
            yield Report(len(scores), len(counts), "view counts")
        self.folder.make()
        self.folder.drop("filtered_*.png", "unfiltered_*.png")
        for score in scores:
            for name in ("unfiltered", "filtered"):
                write_png(self.settings.out / f"{name}_{score.views}.png", getattr(score, name))
        metrics = {"views": [{"count": s.views, **s.scores} for s in scores]}
        self.folder.finish(self.settings, metrics, self._page(scores), self.device)

    def _page(self, scores: list[ViewScore]) -> Page:
        page = Page(
            "Radiance field tomography: a first look",
            "Shepp-Logan phantom from exact projections, without and with the ramp filter",
        )
        page.figure(
            figure_png(study_panels(scores)),
            caption="Above: backprojection without a filter. The views sample low frequencies "
            "too densely, and that bias washes out the detail however many views there are. "
            "Below: the ramp filter takes the bias away.",
            alt="Reconstructions for growing numbers of views, unfiltered above, filtered below",
        )
        page.table(COLUMNS, self.rows, caption=SCORING)
        views = [s.views for s in scores]
        for metric, label in (("psnr", "PSNR, dB"), ("ssim", "SSIM")):
            figure = study_curves(views, [s.scores for s in scores], metric, label)
            page.figure(figure_png(figure), caption=SCORING, alt=f"{label} against views")
        return page


def study_row(score: ViewScore) -> tuple[float, ...]:
    """A row of the table of scores."""
    return (score.views, *(score.scores[key] for key in SCORES))


def study_panels(scores: list[ViewScore]) -> Any:
    """The slices of a study: unfiltered above, filtered below."""
    return image_grid(
        [s.unfiltered for s in scores] + [s.filtered for s in scores],
        titles=[f"{s.views} views" for s in scores] + [""] * len(scores),
        columns=len(scores),
        window=(0.0, 0.5),
        row_labels=["unfiltered", "filtered"],
    )


def study_curves(
    views: Sequence[int], scores: Sequence[Mapping[str, float]], metric: str, label: str
) -> Any:
    """One metric of a study against the number of views."""
    series = {
        name: (views, [score[f"{metric}_{name}"] for score in scores])
        for name in ("unfiltered", "filtered")
    }
    return curves(series, xlabel="number of views", ylabel=label, log_x=True)
