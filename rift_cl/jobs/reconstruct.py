"""``rift reconstruct``: a scan goes in, quantitative slices come out.

Rows are read, corrected, reconstructed and written a slab at a time, as many together as the
memory budget allows, so that the size of a scan is bounded by the disk alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import format_bytes, plan_chunks
from rift_cl.cl.device import Device
from rift_cl.geometry import Grid, Parallel
from rift_cl.io.scan_file import ScanFile
from rift_cl.io.volume import open_volume
from rift_cl.jobs.reconstruct_report import Preview, reconstruction_page
from rift_cl.jobs.run_folder import RunFolder
from rift_cl.jobs.scan_input import (
    VOLUME_NAMES,
    ScanInput,
    check_center,
    chosen_rows,
    read_attenuation,
)
from rift_cl.operators import HighPass, Projector, Ramp
from rift_cl.progress import Report
from rift_cl.reconstruct import Attenuation, backproject, fbp, find_center

# Slices between two reports of progress.
_SLAB = 16


@dataclass(frozen=True)
class ReconstructSettings(ScanInput):
    """Reconstruct a parallel-beam scan, slice by slice.

    Example: rift reconstruct scan.h5 --out slices --filter shepp-logan --format zarr
    """

    out: Path = Path("rift-reconstruct")
    """Folder for the slices, report.html, config.json and metrics.json."""
    method: Literal["fbp", "backproject"] = "fbp"
    """Filtered backprojection, or backprojection without a filter."""
    filter: Literal["ram-lak", "shepp-logan", "cosine", "hamming", "hann", "high-pass"] = "ram-lak"
    """Filter along the detector."""
    cutoff: float = 1.0
    """Where the filter's window ends, as a fraction of the Nyquist frequency."""
    exponent: float = 1.0
    """Of the high-pass |f|^exponent; 1 is the ramp."""
    center: float | None = None
    """Detector bin of the rotation axis; found automatically when not given."""
    rows: tuple[int, int] | None = None
    """First detector row, and the one after the last."""
    pitch: float | None = None
    """Distance between detector bins; the file's own, or 1 bin, when not given."""
    unit: str | None = None
    """Unit of the pitch, such as mm."""
    format: Literal["tiff", "zarr", "h5"] = "tiff"
    """A folder of TIFF slices, a Zarr store, or one HDF5 file."""
    overwrite: bool = False
    """Replace an earlier reconstruction in the same folder."""
    dry_run: bool = False
    """Show what would be done, and write nothing."""


class Reconstruction:
    """A reconstruction that is planned: the input is open, nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """

    def __init__(self, settings: ReconstructSettings) -> None:
        self.settings = settings
        self.device: Device = settings.open_device()
        self.scan: ScanFile = settings.open_scan()
        self.rows = chosen_rows(settings.rows, self.scan)
        self.pitch = (self.scan.pitch or 1.0) if settings.pitch is None else settings.pitch
        unit = self.scan.unit or ("bin" if self.pitch == 1.0 else "")
        self.unit = unit if settings.unit is None else settings.unit
        self.filter = _filter(settings)
        # Made now, so that a bad pitch or center is told before any work.
        self._geometry(settings.center)
        check_center(settings.center, self.scan)
        self.folder = RunFolder(settings.out, "reconstruct", overwrite=settings.overwrite)
        self.metrics: dict[str, Any] = {}
        self._preview = Preview.of(self.shape[0])

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the volume, (z, y, x)."""
        bins = self.scan.shape[2]
        return self.rows[1] - self.rows[0], bins, bins

    @cached_property
    def slabs(self) -> list[slice]:
        """Slices that are worked on together, counted from the first row that was asked for."""
        views, _, bins = self.scan.shape
        # Counts, line integrals and a temporary on the host, then sinogram and filtered sinogram
        # on the device; the slice on both.
        each = 4 * (5 * views * bins + 2 * bins * bins)
        scratch = self._projector(1, None).scratch
        chunks = plan_chunks(self.shape[0], each, scratch, self.device.budget, what="slice")
        return [s for chunk in chunks for s in _cut(chunk)]

    def plan(self) -> dict[str, str]:
        """What would be done, for ``--dry-run``; one slice is reconstructed to tell the time."""
        seconds = self._seconds_per_slice() * self.shape[0]
        return {
            "scan": f"{self.scan.path} ({self.scan.source}, {self.scan.kind})",
            "projections": f"{self.scan.shape} (angle, row, bin)",
            "volume": f"{self.shape} (z, y, x), {format_bytes(4 * math.prod(self.shape))}",
            "slabs": f"{len(self.slabs)} of at most {max(s.stop - s.start for s in self.slabs)}",
            "device": f"{self.device.name}, budget {format_bytes(self.device.budget)}",
            "output": str(self.settings.out / VOLUME_NAMES[self.settings.format]),
            "time": f"about {seconds:.3g} s, from one slice",
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report after every slab."""
        begin = time.perf_counter()
        center = self.settings.center
        if center is None:
            yield Report(0, self.shape[0], "slices")
            center = self._find_center()
        self.folder.make()
        try:
            yield from self._write(center)
        except BaseException:
            self.folder.discard()
            raise
        # From here on the slices are this run's, and an earlier configuration no longer theirs.
        self.folder.mark()
        formats = set(VOLUME_NAMES.values()) - {VOLUME_NAMES[self.settings.format]}
        self.folder.drop(*formats)
        self.metrics["seconds"] = time.perf_counter() - begin
        page = reconstruction_page(self, self._preview)
        self.folder.finish(self.settings, self.metrics, page, self.device)

    def _write(self, center: float) -> Iterator[Report]:
        settings, count = self.settings, self.shape[0]
        path = settings.out / VOLUME_NAMES[settings.format]
        spacing = (self.pitch,) * 3
        self.metrics = {"center": center, "dead_pixels": 0, "starved_samples": 0}
        projectors: dict[int, Projector] = {}
        with open_volume(
            path, self.shape, format=settings.format, spacing=spacing, unit=self.unit
        ) as volume:
            for slab in self.slabs:
                size = slab.stop - slab.start
                A = projectors.setdefault(size, self._projector(size, center))
                integrals = self._line_integrals(slab)
                self.metrics["dead_pixels"] += integrals.dead
                self.metrics["starved_samples"] += integrals.starved
                slices = self._invert(A, integrals.projections)
                volume.write(slab.start, slices)
                self._preview.take(slab.start, slices)
                yield Report(slab.stop, count, "slices", {"center": center})
        self.metrics.update(self._preview.statistics())

    def _line_integrals(self, slab: slice) -> Attenuation:
        first = self.rows[0]
        return read_attenuation(self.scan, first + slab.start, first + slab.stop)

    def _invert(self, A: Projector, projections: NDArray[np.float32]) -> NDArray[np.float32]:
        if self.settings.method == "backproject":
            return np.asarray(backproject(A, projections))
        return np.asarray(fbp(A, projections, self.filter))

    def _find_center(self) -> float:
        middle = sum(self.rows) // 2
        row = read_attenuation(self.scan, middle, middle + 1).projections[:, 0]
        return find_center(row, self.scan.angles, device=self.device).center

    def _geometry(self, center: float | None) -> Parallel:
        return Parallel(self.scan.angles, self.scan.shape[2], self.pitch, center)

    def _projector(self, slices: int, center: float | None) -> Projector:
        grid = Grid((slices, *self.shape[1:]), self.pitch)
        return Projector(grid, self._geometry(center), device=self.device)

    def _seconds_per_slice(self) -> float:
        A = self._projector(1, self.settings.center)
        # Twice: the first time builds the kernels.
        for _ in range(2):
            begin = time.perf_counter()
            self._invert(A, self._line_integrals(slice(0, 1)).projections)
        return time.perf_counter() - begin


def _cut(chunk: slice) -> list[slice]:
    starts = range(chunk.start, chunk.stop, _SLAB)
    return [slice(start, min(start + _SLAB, chunk.stop)) for start in starts]


def _filter(settings: ReconstructSettings) -> Ramp | HighPass:
    if settings.filter == "high-pass":
        return HighPass(settings.exponent)
    return Ramp(settings.filter, settings.cutoff)
