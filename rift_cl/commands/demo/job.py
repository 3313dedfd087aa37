"""``rift demo``: both ways to a radiance field, so that a new user sees them work in a minute.

Integration: a phantom from exact projections, by filtered backprojection. Regression: splats fitted
to the captures that come with the package, a ring round an ornament and a wall that is seen from
one side; each leaves a folder as ``rift fit`` does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from rift_cl.commands.demo.settings import DemoSettings
from rift_cl.commands.demo.view_study import ViewScore, view_study
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.report import show_fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.render.job import Render
from rift_cl.commands.render.settings import RenderSettings
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import InputError
from rift_cl.io.images.image import write_png
from rift_cl.progress import Report
from rift_cl.report.html_page import Page
from rift_cl.report.plot import WIDE, curves, figure_svg, figure_svgs, image_grid
from rift_cl.sample import ornament, ornament_off_path, wall

COLUMNS = ("views", "PSNR unfiltered", "SSIM unfiltered", "PSNR filtered", "SSIM filtered")
# SSIM looks at windows of 11 samples.
_SMALLEST = 11
# The fits' folders within the demo's, and what is said of each.
FITS = {
    "ornament": (
        "a glossy ornament from a ring of cameras. Held out are views of that ring, where the mean "
        "of two neighbours already looks good; off_path are views from elsewhere, where it does "
        "not"
    ),
    "wall": (
        "a wall from its front, as one photographs what hangs there: nobody saw what lies behind "
        "it. Every eighth view is held out"
    ),
}
# The film of the wall.
FILM, _FRAMES = "film", 48
SCORES = ("psnr_unfiltered", "ssim_unfiltered", "psnr_filtered", "ssim_filtered")

SCORING = (
    "PSNR in dB (peak 1) and SSIM, inside the inscribed disc. Unfiltered slices are scored after "
    "an affine fit to the phantom (gain and offset), filtered ones as they are."
)


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
        self.device = settings.open_device()
        self.folder = RunFolder(settings.out, "demo", overwrite=True)
        # Whatever else is there under a fit's name is not lost either.
        for name in FITS:
            RunFolder(settings.out / name, "fit photos", overwrite=True)
        RunFolder(settings.out / FILM, "render", overwrite=True)
        self.fits = {name: Fit(self._fit_settings(name)) for name in FITS if settings.steps}
        self.rows: list[tuple[float, ...]] = []

    def _fit_settings(self, name: str) -> FitPhotosSettings:
        settings, ring = self.settings, name == "ornament"
        return FitPhotosSettings.of(
            capture=ornament() if ring else wall(),
            test=(ornament_off_path(),) if ring else (),
            out=settings.out / name,
            steps=settings.steps if ring else -(-settings.steps // 3),
            splats=settings.splats,
            checkpoint_every=0,
            device=settings.device,
            overwrite=True,
        )

    def _film_settings(self) -> RenderSettings:
        settings = self.settings
        return RenderSettings(
            scene=settings.out / "wall",
            out=settings.out / FILM,
            frames=_FRAMES,
            device=settings.device,
            overwrite=True,
        )

    def run(self) -> Iterator[Report]:
        """Do it; a report after every number of views, and those of the fit."""
        counts = self.settings.views
        scores = []
        for score in view_study(self.settings.size, counts, self.device):
            scores.append(score)
            self.rows.append(study_row(score))
            yield Report(len(scores), len(counts), "view counts")
        self.folder.make()
        self.folder.drop("filtered_*.png", "unfiltered_*.png", *FITS, FILM)
        for score in scores:
            for name in ("unfiltered", "filtered"):
                write_png(self.settings.out / f"{name}_{score.views}.png", getattr(score, name))
        metrics: dict[str, Any] = {"views": [{"count": s.views, **s.scores} for s in scores]}
        page = Page("Radiance field tomography: a first look", "By integration and by regression")
        _show_study(page, scores, self.rows)
        for name, fit in self.fits.items():
            yield from fit.run()
            metrics.setdefault("fits", {})[name] = fit.metrics
            _show_regression(page, name, fit)
        if self.fits:
            film = Render(self._film_settings())
            yield from film.run()
            _show_film(page, film)
        self.folder.finish(self.settings, metrics, page, self.device)


def _show_study(page: Page, scores: list[ViewScore], rows: list[tuple[float, ...]]) -> None:
    page.section("Integration: a phantom from exact projections")
    page.figure(
        figure_svg(study_panels(scores)),
        caption="Above: backprojection without a filter. The views sample low frequencies "
        "too densely, and that bias washes out the detail however many views there are. "
        "Below: the ramp filter takes the bias away.",
        alt="Reconstructions for growing numbers of views, unfiltered above, filtered below",
    )
    page.table(COLUMNS, rows, caption=f"{SCORING} {what_to_see(rows)}")
    views = [s.views for s in scores]
    for metric, label in (("psnr", "PSNR, dB"), ("ssim", "SSIM")):
        draw = partial(study_curves, views, [s.scores for s in scores], metric, label)
        page.figure(figure_svgs(draw), caption=SCORING, alt=f"{label} against views")


def _show_regression(page: Page, name: str, fit: Fit) -> None:
    page.section(f"Regression: splats fitted to pictures of the {name}")
    page.paragraph(
        f"{fit.metrics['splats']} splats after {fit.steps} steps on path-traced pictures "
        f"of {FITS[name]}. This is a beginning: 'rift fit' takes more steps and more splats. "
        f"'rift view' shows the splats, which are in the folder {name}."
    )
    show_fit(page, fit.scores, fit.losses, fit.metrics)


def _show_film(page: Page, film: Render) -> None:
    page.section("A film of the wall")
    if film.moving is not None:
        page.figure(
            film.moving,
            caption="There and back along the way of the photographs, and nowhere else: what "
            f"nobody saw is unknown. The film and its frames are in the folder {FILM}.",
            alt="The wall, seen by a camera that goes to and fro before it",
        )


def study_row(score: ViewScore) -> tuple[float, ...]:
    """A row of the table of scores."""
    return (score.views, *(score.scores[key] for key in SCORES))


def what_to_see(rows: Sequence[tuple[float, ...]]) -> str:
    """What the table of scores shows, a sentence; rows as ``study_row`` makes them."""
    views, unfiltered, _, filtered, _ = max(rows)
    told = (
        f"More dB are better: with {views:g} views the filtered slice has {filtered:.1f} dB, the "
        f"unfiltered one {unfiltered:.1f}."
    )
    worse = [row[0] for row in rows if row[3] < row[1]]
    if filtered <= unfiltered or not worse:
        return told
    return f"{told} With {max(worse):g} views and fewer, streaks cost the filtered slice more."


def study_panels(scores: list[ViewScore], size: float = 2.4) -> Any:
    """The slices of a study, ``size`` inches each: unfiltered above, filtered below."""
    return image_grid(
        [s.unfiltered for s in scores] + [s.filtered for s in scores],
        titles=[f"{s.views} views" for s in scores] + [""] * len(scores),
        columns=len(scores),
        window=(0.0, 0.5),
        row_labels=["unfiltered", "filtered"],
        size=size,
    )


def study_curves(
    views: Sequence[int],
    scores: Sequence[Mapping[str, float]],
    metric: str,
    label: str,
    width: int = WIDE,
) -> Any:
    """One metric of a study against the number of views."""
    series = {
        name: (views, [score[f"{metric}_{name}"] for score in scores])
        for name in ("unfiltered", "filtered")
    }
    return curves(series, xlabel="number of views", ylabel=label, log_x=True, width=width)
