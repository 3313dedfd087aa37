"""What ``rift reconstruct`` shows: a few slices, their histogram of values, the run's figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import format_bytes
from rift_cl.html_page import Page
from rift_cl.io.output import atomic_path
from rift_cl.jobs.few import evenly
from rift_cl.jobs.reconstruct.decided import in_words
from rift_cl.jobs.reconstruct.volume import volume_path
from rift_cl.plot import curves, figure_png, image_grid

if TYPE_CHECKING:
    from rift_cl.jobs.reconstruct.job import Reconstruction

_PANELS = 6
# Values that a histogram tells apart.
_BARS = 128
PREVIEW_PICTURE = "preview.png"
# The display window leaves out this share of the darkest and of the brightest samples.
_TAIL = 0.5


@dataclass
class Preview:
    """Collects a few slices and the statistics of all of them as they pass.

    Args:
        count: slices of the volume.
        slices: those kept so far, by their number: some for the report, and the middle one.
    """

    count: int
    slices: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    _lowest: float = np.inf
    _highest: float = -np.inf
    _sum: float = 0.0
    _samples: int = 0

    @property
    def panels(self) -> list[int]:
        """Numbers of the slices that the report shows, evenly from the first to the last."""
        return evenly(self.count, min(self.count, _PANELS))

    @property
    def middle(self) -> NDArray[np.float32]:
        """The middle slice."""
        return self.slices[self.count // 2]

    def take(self, start: int, block: NDArray[np.float32]) -> None:
        """Look at a block of slices, the first of which is number ``start``."""
        self._lowest = min(self._lowest, float(block.min()))
        self._highest = max(self._highest, float(block.max()))
        self._sum += float(block.sum(dtype=np.float64))
        self._samples += block.size
        for index in {*self.panels, self.count // 2} & set(range(start, start + len(block))):
            self.slices[index] = block[index - start].copy()

    def statistics(self) -> dict[str, float]:
        """Least, greatest and mean value of the whole volume."""
        mean = self._sum / self._samples
        return {"minimum": self._lowest, "maximum": self._highest, "mean": mean}


def planned(job: Reconstruction, seconds: float) -> dict[str, str]:
    """What would be done, in words; ``seconds`` is what it would take."""
    scan, device = job.source.scan, job.device
    return {
        "scan": f"{scan.path} ({scan.source}, {scan.kind})",
        "projections": f"{scan.shape} (angle, row, bin)",
        "volume": f"{job.shape} (z, y, x), {format_bytes(4 * math.prod(job.shape))}",
        "method": job.settings.method,
        "assumed": " ".join(job.source.notes) or "nothing",
        "slabs": f"{len(job.slabs)} of at most {max(s.stop - s.start for s in job.slabs)}",
        "device": f"{device.name}, budget {format_bytes(device.budget)}",
        "output": str(volume_path(job.settings)),
        "time": f"about {seconds:.3g} s, from one slice",
    }


def write_preview(path: Path, image: NDArray[np.float32], title: str) -> None:
    """Write a picture of one slice, for a look before the others are done."""
    figure = image_grid([image], titles=[title], columns=1, window=_window([image]), size=6.0)
    with atomic_path(path) as part:
        part.write_bytes(figure_png(figure))


def reconstruction_page(job: Reconstruction, preview: Preview) -> Page:
    """The report of a finished reconstruction."""
    page = Page(f"Reconstruction of {job.source.scan.path.name}", f"{job.shape[0]} slices")
    kept = preview.panels
    images = [preview.slices[index] for index in kept]
    titles = [f"slice {job.rows[0] + index}" for index in kept]
    columns = min(3, len(images))
    figure = image_grid(images, titles=titles, columns=columns, window=_window(images), size=4.0)
    page.figure(
        figure_png(figure),
        caption=f"Attenuation per {job.source.unit or 'unit of length'}.",
        alt=f"{len(images)} reconstructed slices",
    )
    if job.source.notes:
        page.section("What was assumed and mended")
        for note in job.source.notes:
            page.paragraph(note)
    _residuals(page, job.inversion.residuals)
    _histogram(page, images, job.source.unit)
    page.section("Result")
    page.facts(_facts(job))
    return page


def _window(images: list[NDArray[np.float32]]) -> tuple[float, float]:
    """Black and white for some slices, less the samples that would take all the contrast."""
    low, high = np.percentile(np.stack(images), [_TAIL, 100 - _TAIL])
    return float(low), float(high) if high > low else float(low) + 1


def _residuals(page: Page, residuals: Mapping[int, list[float]]) -> None:
    """Curves of the residual, where the method took steps."""
    curves_of = {number: curve for number, curve in sorted(residuals.items()) if curve}
    if not curves_of:
        return
    few = [list(curves_of)[k] for k in evenly(len(curves_of), min(len(curves_of), _PANELS))]
    series = {
        f"slice {number}": (np.arange(1, len(curves_of[number]) + 1), curves_of[number])
        for number in few
    }
    title = "residual, root mean square"
    figure = curves(series, xlabel="step", ylabel=title, log_x=True)
    page.section("Steps")
    page.figure(
        figure_png(figure),
        caption="How far the projections of the slice are from the measured ones, in the unit of "
        "a line integral.",
        alt="Curves of the residual over the steps",
    )


def _histogram(page: Page, images: list[NDArray[np.float32]], unit: str) -> None:
    low, high = _window(images)
    counts, edges = np.histogram(np.stack(images), bins=_BARS, range=(low, high))
    share = 100 * counts / max(counts.sum(), 1)
    per = f"per {unit}" if unit else "per unit of length"
    figure = curves(
        {"samples": ((edges[1:] + edges[:-1]) / 2, share)},
        xlabel=f"attenuation, {per}",
        ylabel="samples, %",
    )
    page.section("Values")
    page.figure(
        figure_png(figure),
        caption="How often each value occurs in the slices above.",
        alt="Histogram of the values",
    )


def _axis(job: Reconstruction) -> str:
    axis = job.source.axis
    return f"bin {axis['center']:.2f}, by {axis['by']}"


def _facts(job: Reconstruction) -> dict[str, Any]:
    scan, window = job.source.scan, job.inversion.window
    return {
        "projections": f"{scan.shape} (angle, row, bin)",
        "volume": f"{job.shape} (z, y, x)",
        "file": f"{scan.source}, {scan.kind}",
        "method": in_words(job.decided),
        "axis": _axis(job),
        "spacing": f"{window.pixel:g} {job.source.unit}",
        **job.metrics,
    }
