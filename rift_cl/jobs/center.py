"""``rift center``: where the rotation axis is, with the pictures to believe it by."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Parallel
from rift_cl.html_page import Page
from rift_cl.jobs.axis_search import find_axis
from rift_cl.jobs.run_folder import RunFolder
from rift_cl.jobs.scan_input import ScanInput, read_attenuation
from rift_cl.operators import Projector
from rift_cl.plot import curves, figure_png, image_grid
from rift_cl.progress import Report
from rift_cl.reconstruct import AxisEstimate, fbp

# Centres of the contact sheet, in bins from the best one.
_SHEET = (-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0)


@dataclass(frozen=True)
class CenterSettings(ScanInput):
    """Find the centre of rotation of a parallel-beam scan.

    Example: rift center scan.h5 --out center
    """

    out: Path = Path("rift-center")
    """Folder for the contact sheet, the score curves and report.html."""
    row: int | None = None
    """Detector row to look at; the middle one when not given."""
    span: tuple[float, float] | None = None
    """First and last detector bin between which to search; the middle half when not given."""


class CenterJob:
    """A search that is planned: the input is open, nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """

    def __init__(self, settings: CenterSettings) -> None:
        self.settings = settings
        self.device = settings.open_device()
        self.scan = settings.open_scan()
        self.folder = RunFolder(settings.out, "center", overwrite=True)
        self.row = self.scan.shape[1] // 2 if settings.row is None else settings.row
        if not 0 <= self.row < self.scan.shape[1]:
            raise InputError(f"--row is {self.row}, {self.scan.path} has {self.scan.shape[1]} rows")
        self.metrics: dict[str, Any] = {}

    def run(self) -> Iterator[Report]:
        """Do it: the search, then a slice for each centre of the contact sheet."""
        total = 1 + len(_SHEET)
        yield Report(0, total, "steps")
        sinogram = read_attenuation(self.scan, self.row, self.row + 1).projections[:, 0]
        found = find_axis(self.scan, self.device, span=self.settings.span)
        self.metrics = {**found.record(), "row": self.row}
        slices = {}
        for step, offset in enumerate(_SHEET, start=1):
            yield Report(step, total, "steps", {"center": found.center})
            slices[found.center + offset] = self._slice(sinogram, found.center + offset)
        self.folder.make()
        self.folder.finish(self.settings, self.metrics, self._page(found, slices), self.device)
        yield Report(total, total, "steps", {"center": found.center})

    def _slice(self, sinogram: NDArray[np.float32], center: float) -> NDArray[np.float32]:
        bins = self.scan.shape[2]
        geometry = Parallel(self.scan.angles, bins, center=center)
        A = Projector(Grid((bins, bins)), geometry, device=self.device)
        return np.asarray(fbp(A, sinogram))

    def _page(self, found: AxisEstimate, slices: dict[float, NDArray[np.float32]]) -> Page:
        page = Page(f"Centre of rotation of {self.scan.path.name}", f"bin {found.center:.2f}")
        best = slices[found.center]
        low, high = np.percentile(best, [0.5, 99.5])
        sheet = image_grid(
            [_middle(image) for image in slices.values()],
            titles=[f"{center:.2f}" for center in slices],
            columns=3,
            window=(float(low), float(high)) if high > low else None,
            size=3.2,
        )
        page.figure(
            figure_png(sheet),
            caption="The middle of the slice for centres about the best one, which is in the "
            "middle; a wrong one shows arcs and doubled edges.",
            alt=f"{len(slices)} slices reconstructed with different centres",
        )
        self._score_curves(page, found)
        return page

    def _score_curves(self, page: Page, found: AxisEstimate) -> None:
        title = "log-likelihood"
        figure = curves(
            {"score": (found.scores[0], found.scores[1])},
            xlabel="centre, bins",
            ylabel=title,
            mark=round(found.center, 2),
        )
        page.figure(
            figure_png(figure),
            caption="How likely each centre is, by all rows together (" + found.by + ").",
            alt=f"Curve of {title}",
        )


def _middle(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The central half of an image, where a wrong centre shows first."""
    ny, nx = (max(n // 4, 0) for n in image.shape)
    return image[ny : image.shape[0] - ny, nx : image.shape[1] - nx]
