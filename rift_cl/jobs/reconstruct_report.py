"""What ``rift reconstruct`` shows: a few slices, their histogram of values, the run's figures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.html_page import Page
from rift_cl.jobs.few import evenly
from rift_cl.plot import figure_png, image_grid

if TYPE_CHECKING:
    from rift_cl.jobs.reconstruct import Reconstruction

_PANELS = 6
# The display window leaves out this share of the darkest and of the brightest samples.
_TAIL = 0.5


@dataclass
class Preview:
    """Collects a few slices and the statistics of all of them as they pass.

    Args:
        wanted: the slices to keep.
        slices: those seen so far, by their number.
    """

    wanted: frozenset[int]
    slices: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    _lowest: float = np.inf
    _highest: float = -np.inf
    _sum: float = 0.0
    _count: int = 0

    @classmethod
    def of(cls, count: int) -> Preview:
        """For a volume of ``count`` slices, kept evenly from the first to the last."""
        kept = evenly(count, min(count, _PANELS))
        return cls(frozenset(int(i) for i in kept))

    def take(self, start: int, block: NDArray[np.float32]) -> None:
        """Look at a block of slices, the first of which is number ``start``."""
        self._lowest = min(self._lowest, float(block.min()))
        self._highest = max(self._highest, float(block.max()))
        self._sum += float(block.sum(dtype=np.float64))
        self._count += block.size
        for index in self.wanted & set(range(start, start + len(block))):
            self.slices[index] = block[index - start].copy()

    def statistics(self) -> dict[str, float]:
        """Least, greatest and mean value of the whole volume."""
        mean = self._sum / self._count
        return {"minimum": self._lowest, "maximum": self._highest, "mean": mean}


def reconstruction_page(job: Reconstruction, preview: Preview) -> Page:
    """The report of a finished reconstruction."""
    page = Page(f"Reconstruction of {job.scan.path.name}", f"{job.shape[0]} slices")
    kept = sorted(preview.slices)
    images = [preview.slices[index] for index in kept]
    low, high = np.percentile(np.stack(images), [_TAIL, 100 - _TAIL])
    window = (float(low), float(high) if high > low else float(low) + 1)
    titles = [f"slice {job.rows[0] + index}" for index in kept]
    columns = min(3, len(images))
    figure = image_grid(images, titles=titles, columns=columns, window=window, size=4.0)
    page.figure(
        figure_png(figure),
        caption=f"Attenuation per {job.unit or 'unit of length'}.",
        alt=f"{len(images)} reconstructed slices",
    )
    page.section("Result")
    page.facts(_facts(job))
    return page


def _facts(job: Reconstruction) -> dict[str, Any]:
    return {
        "projections": f"{job.scan.shape} (angle, row, bin)",
        "volume": f"{job.shape} (z, y, x)",
        "file": f"{job.scan.source}, {job.scan.kind}",
        "spacing": f"{job.pitch:g} {job.unit}",
        **job.metrics,
    }
