"""The report of ``rift reconstruct``: slices, a histogram of values, the figures of the run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import format_bytes
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.pictures.slice_pictures import (
    ENOUGH,
    FRAMES,
    UPRIGHT,
    display_window,
    show_slices,
    smaller,
    thinned,
)
from rift_cl.commands.reconstruct.cone_input import VolumeWindow
from rift_cl.commands.reconstruct.decided import in_words
from rift_cl.commands.reconstruct.volume import volume_path
from rift_cl.io.output import atomic_path
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_png, figure_svgs, image_grid

if TYPE_CHECKING:
    from rift_cl.commands.reconstruct.cone_job import ConeReconstruction
    from rift_cl.commands.reconstruct.job import Reconstruction

_PANELS = 6
# Values that a histogram tells apart.
_BARS = 128
PREVIEW_PICTURE = "preview.png"


class Preview:
    """Collects a few slices and the statistics of all of them as they pass, in any order.

    Args:
        count: slices of the volume.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self.panels: dict[int, NDArray[np.float32]] = {}
        """Samples of a few slices so far, by their number (``thinned``)."""
        self.middle: NDArray[np.float32] | None = None
        """The middle slice, once it has passed."""
        self.frames: dict[int, NDArray[np.float32]] = {}
        """More of them, made smaller, for the slider through z."""
        # Of planes along the axis, for the slider through y, a row of every slice, made smaller: by
        # the number of the row, then by that of the slice.
        self._upright: dict[int, dict[int, NDArray[np.float32]]] = {}
        # Slice by slice, so that no sum depends on how they were cut into slabs.
        self._lowest, self._highest, self._sums = np.zeros((3, count))
        self._samples = 0

    @property
    def numbers(self) -> list[int]:
        """Numbers of a few slices, evenly from the first to the last."""
        return evenly(self.count, min(self.count, _PANELS))

    @property
    def images(self) -> list[NDArray[np.float32]]:
        """Samples of a few slices, from the first to the last."""
        return [self.panels[number] for number in sorted(self.panels)]

    @property
    def planes(self) -> dict[int, NDArray[np.float32]]:
        """Planes along the axis by their numbers, from the first slice to the last."""
        return {
            number: np.stack([rows[index] for index in sorted(rows)])
            for number, rows in self._upright.items()
        }

    def take(self, start: int, block: NDArray[np.float32]) -> None:
        """Look at a block of slices, the first of which is number ``start``."""
        for index, image in enumerate(block, start):
            self._lowest[index], self._highest[index] = image.min(), image.max()
            self._sums[index] = image.sum(dtype=np.float64)
            self._samples = image.size
        passing = range(start, start + len(block))
        for index in self.numbers:
            if index in passing:
                self.panels[index] = thinned(block[index - start]).copy()
        if self.count // 2 in passing:
            self.middle = block[self.count // 2 - start].copy()
        for index in evenly(self.count, min(self.count, FRAMES)):
            if index in passing:
                self.frames[index] = smaller(block[index - start])
        if self.count >= ENOUGH:
            for row in evenly(block.shape[1], min(block.shape[1], UPRIGHT)):
                rows = smaller(block[:, row], axes=(1,))
                self._upright.setdefault(row, {}).update(zip(passing, rows, strict=True))

    def statistics(self) -> dict[str, float]:
        """Least, greatest and mean value of the whole volume."""
        mean = float(self._sums.sum()) / (self._samples * self.count)
        lowest, highest = float(self._lowest.min()), float(self._highest.max())
        return {"minimum": lowest, "maximum": highest, "mean": mean}


def planned(job: Reconstruction, seconds: float) -> dict[str, str]:
    """What would be done, in words; ``seconds`` is what it would take."""
    scan, device = job.source.scan, job.device
    spread = {} if job.settings.cluster is None else {"workers": job.settings.cluster}
    return {
        "scan": f"{scan.path} ({scan.source}, {scan.kind})",
        "projections": f"{scan.shape} (angle, row, bin)",
        "volume": f"{job.shape} (z, y, x), {format_bytes(4 * math.prod(job.shape))}",
        "voxel": voxel(job),
        "method": job.settings.method,
        "assumed": " ".join(job.source.notes) or "nothing",
        "slabs": f"{len(job.slabs)} of at most {max(s.stop - s.start for s in job.slabs)}",
        "device": f"{device.name}, budget {format_bytes(device.budget)}",
        **spread,
        "output": str(volume_path(job.settings)),
        "time": f"about {seconds:.3g} s, from one slice",
    }


def voxel(job: Reconstruction | ConeReconstruction) -> str:
    """Edges of a voxel and the unit of its value, in words."""
    if isinstance(job.inversion.window, VolumeWindow):
        edges = job.inversion.window.whole.spacing
    else:
        edges = (job.source.row_pitch, *(job.inversion.window.pixel,) * 2)
    alike = max(edges) - min(edges) <= 1e-6 * max(edges)
    sizes = " x ".join(f"{edge:.4g}" for edge in (edges[-1:] if alike else edges))
    named = "" if alike else " (z, y, x)"
    values = _per(job) or "without a unit"
    return f"{sizes} {job.source.unit}".rstrip() + f"{named}; values {values}"


def figures(job: Reconstruction | ConeReconstruction) -> dict[str, Any]:
    """The figures of a finished run for people, with the voxel and units."""
    metrics = dict(job.metrics)
    if not {"minimum", "mean"} <= metrics.keys():
        return metrics
    per = _per(job)
    for name in ("minimum", "maximum", "mean"):
        metrics[name] = f"{metrics[name]:.4g} {per}".rstrip()
    return {"voxel": voxel(job), **metrics}


def _per(job: Reconstruction | ConeReconstruction) -> str:
    """The unit of the values in words; empty where they have none."""
    return f"per {job.source.unit or 'unit of length'}" if job.settings.attenuation else ""


def _values(job: Reconstruction | ConeReconstruction) -> str:
    """What slices hold, with its unit."""
    per = _per(job)
    return f"Attenuation {per}" if per else "Unfiltered backprojection"


def write_preview(path: Path, image: NDArray[np.float32], title: str) -> None:
    """Write a picture of one slice, for a look before the others are done."""
    figure = image_grid(
        [image], titles=[title], columns=1, window=display_window([image]), size=6.0
    )
    with atomic_path(path) as part:
        part.write_bytes(figure_png(figure))


def reconstruction_page(job: Reconstruction | ConeReconstruction, preview: Preview) -> Page:
    """The report of a finished reconstruction."""
    page = Page(f"Reconstruction of {job.source.scan.path.name}", f"{job.shape[0]} slices")
    images, frames = preview.images, sorted(preview.frames.items())
    window, values = display_window(images), _values(job)
    show_slices(
        page,
        [frame for _, frame in frames],
        labels=[f"slice {job.rows[0] + index}" for index, _ in frames],
        window=window,
        what=f"{values}, slices across the axis",
    )
    if planes := preview.planes:
        show_slices(
            page,
            [smaller(plane) for plane in planes.values()],
            labels=[f"y {row}" for row in planes],
            window=window,
            what=f"{values}, planes along the axis",
        )
    if job.source.notes:
        page.section("Assumptions and corrections")
        for note in job.source.notes:
            page.paragraph(note)
    _residuals(page, job.inversion.residuals)
    _histogram(page, images, values)
    page.section("Result")
    page.facts(_facts(job))
    return page


def _residuals(page: Page, residuals: Mapping[int, list[float]]) -> None:
    """Curves of the residual of an iterative method."""
    curves_of = {number: curve for number, curve in sorted(residuals.items()) if curve}
    if not curves_of:
        return
    few = [list(curves_of)[k] for k in evenly(len(curves_of), min(len(curves_of), _PANELS))]
    series = {
        f"slice {number}": (np.arange(1, len(curves_of[number]) + 1), curves_of[number])
        for number in few
    }
    title = "residual, root mean square"
    draw = partial(curves, series, xlabel="iteration", ylabel=title, log_x=True)
    page.section("Convergence")
    page.figure(
        figure_svgs(lambda width: draw(width=width)),
        caption="Difference between the forward projection of the slice and the measurement, in "
        "the unit of a line integral.",
        alt="Residual against iterations",
    )


def _histogram(page: Page, images: list[NDArray[np.float32]], values: str) -> None:
    low, high = display_window(images)
    edges = np.histogram_bin_edges([], bins=_BARS, range=(low, high))
    counts = np.sum([np.histogram(image, bins=edges)[0] for image in images], axis=0)
    share = 100 * counts / max(counts.sum(), 1)
    draw = partial(
        curves,
        {"samples": ((edges[1:] + edges[:-1]) / 2, share)},
        xlabel=values,
        ylabel="samples, %",
    )
    page.section("Values")
    page.figure(
        figure_svgs(lambda width: draw(width=width)),
        caption=f"Histogram of the values in {len(images)} of the slices.",
        alt="Histogram of the values",
    )


def _axis(job: Reconstruction | ConeReconstruction) -> str:
    axis = job.source.axis
    return f"bin {axis['center']:.2f}, by {axis['by']}"


def _facts(job: Reconstruction | ConeReconstruction) -> dict[str, Any]:
    scan = job.source.scan
    return {
        "projections": f"{scan.shape} (angle, row, bin)",
        "volume": f"{job.shape} (z, y, x)",
        "file": f"{scan.source}, {scan.kind}",
        "method": in_words(job.decided),
        "axis": _axis(job),
        **figures(job),
    }
