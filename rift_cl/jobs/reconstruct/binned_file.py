"""A scan read through a coarser detector: means of blocks of pixels, before anything else."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.io.scans.scan_file import RowSource, ScanFile, ScanRows
from rift_cl.reconstruct.preprocess import binned, binned_center

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class BinnedRows:
    """Rows of a coarser detector.

    Args:
        rows: of the detector as it is.
        binning: rows and bins to a block.
    """

    rows: RowSource
    binning: int

    def read(self, start: int, stop: int) -> ScanRows:
        """Read rows of blocks; flats and darks are averaged as the projections are."""
        fine = self.rows.read(start * self.binning, stop * self.binning)
        return ScanRows(*(self._binned(getattr(fine, field.name)) for field in _PARTS))

    def look(self, part: Any, frames: Sequence[int], rows: Sequence[int]) -> Floats:
        """Some rows of some frames."""
        fine = [row * self.binning + k for row in rows for k in range(self.binning)]
        return binned(self.rows.look(part, frames, fine), rows=self.binning, bins=self.binning)

    def _binned(self, frames: Floats | None) -> Any:
        if frames is None:
            return None
        return binned(frames, rows=self.binning, bins=self.binning)


_PARTS = dataclasses.fields(ScanRows)


def binned_file(scan: ScanFile, binning: int) -> ScanFile:
    """A scan of which so many rows and bins are averaged to one.

    Raises:
        InputError: the detector has fewer rows or bins.
    """
    if binning == 1:
        return scan
    views, rows, bins = scan.shape
    if binning > min(rows, bins):
        raise InputError(
            f"--binning is {binning}, the detector of {scan.path} has {rows} rows and {bins} bins"
        )
    fan = scan.fan
    if fan is not None:
        center = binned_center(fan.center, binning)
        fan = dataclasses.replace(fan, pitch=fan.pitch * binning, center=center)
    return dataclasses.replace(
        scan,
        shape=(views, rows // binning, bins // binning),
        pitch=None if scan.pitch is None else scan.pitch * binning,
        rows=BinnedRows(scan.rows, binning),
        fan=fan,
        background=-(-scan.background // binning),
    )
