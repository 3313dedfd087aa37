"""Rows of a scan as its file has them, and which of their pixels and rows hold nothing.

Detectors whose dead pixels are known write NaN there, in every frame: a *mask*. A few rows that
are dead as a whole are put between their neighbours, whatever the beam: cones need every row, and
of parallel rays a slice less would move those above it. More of them side by side are no damage,
but a beam that is narrower than the detector, and are left to whoever divides by it to refuse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import NonFiniteError
from rift_cl.io.scans.literals import Kind
from rift_cl.io.scans.scan_file import ScanFile, ScanRows

Mask = NDArray[np.bool_]
# Rows side by side that are filled from their neighbours at most.
_MOST_ROWS = 3
# Dead rows that are named in a sentence at most.
_LISTED = 6


@dataclass(frozen=True, eq=False)
class DetectorRows:
    """Some rows of a scan, all numbers finite.

    Args:
        frames: projections, flats and darks; 0 where they are masked.
        masked: pixels without a number in any view, in any flat or in any dark, (row, bin).
        kind: what the values are.
    """

    frames: ScanRows
    masked: Mask
    kind: Kind

    @cached_property
    def lost(self) -> Mask:
        """(row,) rows without a pixel that answers to the beam."""
        projections, flats, darks = self.frames.projections, self.frames.flats, self.frames.darks
        masked = np.asarray(self.masked.all(axis=1))
        if self.kind == "attenuation":
            return masked
        dark = np.float32(0) if darks is None else darks.mean(axis=0)
        lit = projections > dark if flats is None else (flats.mean(axis=0) > dark)[None]
        return np.asarray(masked | ~lit.any(axis=(0, 2)))

    def part(self, first: int, stop: int) -> DetectorRows:
        """Those of some rows, counted from the first of these."""
        chosen = slice(first, stop)
        stacks = (self.frames.projections, self.frames.flats, self.frames.darks)
        cut = [None if stack is None else stack[:, chosen] for stack in stacks]
        assert cut[0] is not None
        return DetectorRows(ScanRows(cut[0], cut[1], cut[2]), self.masked[chosen], self.kind)


def read_rows(scan: ScanFile, start: int, stop: int) -> DetectorRows:
    """Read some rows of a scan, all frames of them.

    Raises:
        NonFiniteError: a sample is not finite and no part of a mask; the sentence names the file,
            view, row and bin.
        InputError: the rows cannot be read.
    """
    rows = scan.read(start, stop)
    stacks = {"projections": rows.projections, "flats": rows.flats, "darks": rows.darks}
    given = {name: frames for name, frames in stacks.items() if frames is not None}
    masked = np.zeros(rows.projections.shape[1:], np.bool_)
    if not all(np.isfinite(frames).all() for frames in given.values()):
        for frames in given.values():
            masked |= np.isnan(frames).all(axis=0)
        for name, frames in given.items():
            frames[:, masked] = 0
            _check(frames, f"{scan.path}: {name}", start)
    return DetectorRows(rows, masked, scan.kind)


def _check(frames: NDArray[np.float32], name: str, start: int) -> None:
    finite = np.isfinite(frames)
    if not finite.all():
        view, row, bin = (int(i) for i in np.argwhere(~finite)[0])
        raise NonFiniteError(
            f"{name} hold {np.count_nonzero(~finite)} values that are not finite in these rows, "
            f"the first at view {view}, row {start + row}, bin {bin}: repair the file, or choose "
            "other rows"
        )


def live_ends(scan: ScanFile, first: int, stop: int) -> tuple[int, int] | None:
    """The nearest rows below and above some dead ones that answer to the beam.

    Returns:
        None where one side has none, or more rows between are dead than are filled.
    """
    below = range(first - 1, max(stop - 1 - _MOST_ROWS, 0) - 1, -1)
    above = range(stop, min(first + _MOST_ROWS, scan.shape[1] - 1) + 1)
    ends = [next((row for row in side if not _lost(scan, row)), None) for side in (below, above)]
    if ends[0] is None or ends[1] is None or ends[1] - ends[0] - 1 > _MOST_ROWS:
        return None
    return ends[0], ends[1]


def _lost(scan: ScanFile, row: int) -> bool:
    return bool(read_rows(scan, row, row + 1).lost[0])


def dead_rows_words(rows: Sequence[int]) -> str:
    """A sentence about dead rows that were filled."""
    listed = ", ".join(map(str, rows[:_LISTED])) + (", ..." if rows[_LISTED:] else "")
    words = f"Row {listed} does" if len(rows) == 1 else f"Rows {listed} do"
    return (
        f"{words} not answer to the beam in any bin (dead rows of the detector) and "
        f"{'was' if len(rows) == 1 else 'were'} filled from the rows on either side."
    )


def runs(chosen: Mask) -> list[tuple[int, int]]:
    """First and one after the last of each run of equal values."""
    return list(pairwise([0, *(np.flatnonzero(np.diff(chosen)) + 1).tolist(), len(chosen)]))
