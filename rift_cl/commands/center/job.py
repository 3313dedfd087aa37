"""``rift center``: estimate the rotation axis, with a contact sheet to check it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.center.settings import CenterSettings
from rift_cl.commands.inputs.scan_axis import find_axis, tilt_worth_turning
from rift_cl.commands.inputs.scan_rows import read_attenuation
from rift_cl.commands.options import absolute_paths
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan, Grid, Parallel
from rift_cl.operators import Projector
from rift_cl.progress import Report
from rift_cl.reconstruct import AxisEstimate, fbp
from rift_cl.reconstruct.axis.fan_rays import parallel_views
from rift_cl.reconstruct.axis.search import GIVE_IT
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svgs, framed

# Centres of the slider in bins from the best one, and those of the contact sheet among them.
_SLIDER = (-8.0, -6, -4, -3, -2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2, 3, 4, 6, 8)
_SHEET = (-8.0, -4, -2, -1, 0, 1, 2, 4, 8)
# Where nothing is found, the slider reaches this part of the detector to either side.
_AROUND = 8
# Percentiles of the best slice that are shown black and white, in percent.
_WINDOW = (0.5, 99.5)


class CenterJob:
    """A search that is prepared: the input is open, nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """

    def __init__(self, settings: CenterSettings) -> None:
        self.settings = settings
        self.device = settings.open_device(settings.memory_limit)
        self.scan = settings.open_scan(fan=True)
        self.folder = RunFolder.of(settings, "center")
        # Of a cone, only the row of the source's orbit is a fan.
        self._middle = (self.scan.shape[1] - 1) / 2
        if isinstance(self.scan.cone, Cone):
            self._middle = self.scan.cone.center[0]
        usual = min(max(round(self._middle + 1e-9), 0), self.scan.shape[1] - 1)
        self.row = usual if settings.row is None else settings.row
        if not 0 <= self.row < self.scan.shape[1]:
            raise InputError(f"--row is {self.row}, {self.scan.path} has {self.scan.shape[1]} rows")
        self.metrics: dict[str, Any] = {}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed of the scan, a sentence each."""
        return tuple(self.scan.notes)

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        views, rows, bins = self.scan.shape
        span = self.settings.span
        return {
            "scan": f"{self.scan.path}, {views} views of {rows} x {bins} pixels",
            "search": "default bins" if span is None else f"bins {span[0]:g} to {span[1]:g}",
            "pictures": f"{len(_SLIDER)} slices of row {self.row}",
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Run the search, then reconstruct a slice for each axis position of the slider.

        Raises:
            InputError: the data do not tell the axis; the report has slices to judge by eye.
        """
        total = 1 + len(_SLIDER)
        yield Report(0, total, "steps")
        sinogram = read_attenuation(self.scan, self.row, self.row + 1).projections[:, 0]
        try:
            found = find_axis(self.scan, self.device, span=self.settings.span)
        except InputError as error:
            if GIVE_IT not in str(error):
                raise  # of what was asked for, or of the file: no slice tells more
            why = str(error).replace(GIVE_IT, "")
            yield from self._left_to_the_eye(sinogram, why)
            first, *_, last = self.metrics["shown"]
            raise InputError(
                f"{why}; {self.folder.path / 'report.html'} shows slices with the axis at bins "
                f"{first:.4g} to {last:.4g}: give that of the one without doubled edges "
                "(--center), or look between others (--span A B --overwrite)"
            ) from error
        tilt = tilt_worth_turning(found, self.scan.shape[1])
        told = {"tilt_degrees": tilt} if tilt else {}
        self.metrics = {**found.record(), **told, "row": self.row}
        here = found.center + found.tilt * (self.row - self._middle)
        turned = found.sense is not None and found.sense.sign < 0
        slices = {}
        for step, offset in enumerate(_SLIDER, start=1):
            yield Report(step, total, "steps", {"center": found.center})
            slices[here + offset] = self._slice(sinogram, here + offset, turned=turned)
        self._finish(self._page(found, here, slices))
        yield Report(total, total, "steps", {"center": found.center})

    def _left_to_the_eye(self, sinogram: NDArray[np.float32], why: str) -> Iterator[Report]:
        """A report of slices over the span of the search, or else about the detector's middle."""
        bins = self.scan.shape[2]
        middle, reach = (bins - 1) / 2, bins / _AROUND
        first, last = self.settings.span or (middle - reach, middle + reach)
        slices = {}
        for step, center in enumerate(np.linspace(first, last, len(_SLIDER)).tolist(), start=1):
            yield Report(step, 1 + len(_SLIDER), "steps")
            slices[center] = self._slice(sinogram, center, turned=False)
        self.metrics = {"center": None, "why": why, "shown": list(slices), "row": self.row}
        page = Page(f"Rotation axis of {self.scan.path.name}", "not found; to be chosen by eye")
        page.paragraph(f"{why}.")
        self._show(page, slices, len(_SLIDER) // 2, list(slices)[::2])
        self._finish(page)

    def _finish(self, page: Page) -> None:
        self.folder.make()
        decided = replace(absolute_paths(self.settings), kind=self.scan.kind, row=self.row)
        self.folder.finish(decided, self.metrics, page, self.device, asked=self.settings)

    def _slice(
        self, sinogram: NDArray[np.float32], center: float, *, turned: bool
    ) -> NDArray[np.float32]:
        bins = self.scan.shape[2]
        scan = self.scan.geometry
        if isinstance(scan, Fan | Cone):
            fan = scan if isinstance(scan, Fan) else scan.fan()
            angles = -fan.angles if turned else fan.angles
            rows = sinogram[:, None]
            read = parallel_views(rows, replace(fan, angles=angles, center=center)).whole()
            sinogram = np.ascontiguousarray(read.views[:, 0], np.float32)
            middle = float(np.interp(center, read.bins, np.arange(read.bins.size)))
            geometry = Parallel(read.directions, read.bins.size, center=middle)
        else:
            geometry = Parallel(self.scan.angles, bins, center=center)
        A = Projector(Grid((bins, bins)), geometry, device=self.device)
        return _middle(np.asarray(fbp(A, sinogram)))

    def _show(
        self,
        page: Page,
        slices: dict[float, NDArray[np.float32]],
        start: int,
        sheet: Sequence[float],
    ) -> None:
        """A slider over slices by their axis, beginning at one of them, and some side by side."""
        black, white = (
            float(level) for level in np.percentile(list(slices.values())[start], _WINDOW)
        )
        white = white if white > black else black + 1
        files, _ = framed(list(slices.values()), window=(black, white))
        page.slider(
            files,
            labels=[f"bin {center:.2f}" for center in slices],
            start=start,
            caption=f"Centre of the slice at row {self.row} for the chosen axis; a wrong one shows "
            "arcs and doubled edges.",
            alt="Slice with the centre at",
        )
        by_center = dict(zip(slices, files, strict=True))
        page.panels(
            [by_center[center] for center in sheet],
            titles=[f"{center:.2f}" for center in sheet],
            columns=3,
            caption="The same slices side by side.",
            alt="Slice with the centre at",
        )

    def _page(
        self, found: AxisEstimate, here: float, slices: dict[float, NDArray[np.float32]]
    ) -> Page:
        page = Page(f"Rotation axis of {self.scan.path.name}", found.in_words())
        sheet = [here + offset for offset in _SHEET]
        self._show(page, slices, _SLIDER.index(0.0), sheet)
        page.facts(_facts(found))
        draw = partial(
            curves,
            {"all rows": (found.scores[0], found.scores[1])},
            xlabel="axis at the middle row, bins",
            ylabel="log-likelihood",
            mark=round(found.center, 2),
        )
        page.figure(
            figure_svgs(lambda width: draw(width=width)),
            caption=f"Log-likelihood of each axis position by the {found.by}, summed over the "
            "rows; 0 is expected for data without information on the axis.",
            alt="Log-likelihood against the axis position",
        )
        page.table(
            ["row", "axis, bins", "standard error"],
            [list(row) for row in zip(found.rows, found.centers, found.errors, strict=True)],
            caption="The rows that were used",
        )
        return page


def _facts(found: AxisEstimate) -> dict[str, object]:
    low, high = found.interval
    sense = {} if found.sense is None else {"sense of rotation": found.sense.in_words()}
    doubt = {"doubt": found.doubt} if found.doubt else {}
    return {
        "axis, bins": f"{found.center:.2f}, at the middle row",
        "95 % interval": f"{low:.2f} to {high:.2f}",
        "tilt, bins per row": found.tilt,
        "spread between rows, bins": found.spread,
        "found by": found.by,
        **sense,
        **doubt,
    }


def _middle(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The central half of an image, where a wrong centre shows first."""
    ny, nx = (max(n // 4, 0) for n in image.shape)
    return image[ny : image.shape[0] - ny, nx : image.shape[1] - nx]
