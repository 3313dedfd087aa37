"""A scan read through a coarser detector: means of blocks of pixels, before anything else."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Vectors
from rift_cl.io.scans.scan_file import Part, RowSource, ScanFile, ScanRows
from rift_cl.reconstruct.preprocess import binned, binned_center

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class BinnedRows:
    """Rows of a coarser detector.

    Args:
        fine: reads the rows of the detector as it is.
        rows: rows to a block.
        bins: bins to a block.
    """

    fine: RowSource
    rows: int
    bins: int

    def read(self, start: int, stop: int) -> ScanRows:
        """Read rows of blocks; flats and darks are averaged as the projections are."""
        read = self.fine.read(start * self.rows, stop * self.rows)
        parts = (read.projections, read.flats, read.darks)
        return ScanRows(*(None if part is None else self._binned(part) for part in parts))  # type: ignore[arg-type]

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Floats:
        """Some rows of some frames."""
        fine = [row * self.rows + k for row in rows for k in range(self.rows)]
        return self._binned(self.fine.look(part, frames, fine))

    def _binned(self, frames: Floats) -> Floats:
        return binned(frames, rows=self.rows, bins=self.bins)


def row_binning(scan: ScanFile, binning: int) -> int:
    """Rows to a block: as many as bins, but one where the detector has but one."""
    return 1 if scan.shape[1] == 1 else binning


def _binned_cone(cone: Cone | Vectors, rows: int, bins: int) -> Cone | Vectors:
    """A detector of which blocks of pixels are one; what fills none at the far ends is cut."""
    counts = cone.rows // rows, cone.bins // bins
    if isinstance(cone, Cone):
        center = binned_center(cone.center[0], rows), binned_center(cone.center[1], bins)
        pitch = cone.pitch[0] * rows, cone.pitch[1] * bins
        lengths = cone.source_to_axis, cone.source_to_detector
        return Cone(cone.angles, *counts, pitch, *lengths, center, cone.heights, cone.curved)
    lost = cone.rows - counts[0] * rows, cone.bins - counts[1] * bins
    middle = cone.middle - lost[0] / 2 * cone.down - lost[1] / 2 * cone.across
    return Vectors(cone.source, middle, bins * cone.across, rows * cone.down, *counts)


def binned_file(scan: ScanFile, binning: int) -> ScanFile:
    """A scan of which blocks of detector pixels are averaged to one; see ``row_binning``.

    Raises:
        InputError: the detector has fewer rows or bins.
    """
    if binning == 1:
        return scan
    views, rows, bins = scan.shape
    block = row_binning(scan, binning)
    if block > rows or binning > bins:
        raise InputError(
            f"--binning is {binning}, the detector of {scan.path} has {rows} rows and {bins} bins"
        )
    fan = scan.fan
    if fan is not None:
        center = binned_center(fan.center, binning)
        fan = dataclasses.replace(fan, pitch=fan.pitch * binning, center=center)
    cone = scan.cone
    if cone is not None:
        cone = _binned_cone(cone, block, binning)
    return dataclasses.replace(
        scan,
        shape=(views, rows // block, bins // binning),
        pitch=None if scan.pitch is None else scan.pitch * binning,
        rows=BinnedRows(scan.rows, block, binning),
        row_pitch=None if scan.row_pitch is None else scan.row_pitch * block,
        fan=fan,
        cone=cone,
        background=-(-scan.background // binning),
    )
