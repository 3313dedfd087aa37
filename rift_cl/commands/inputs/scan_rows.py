"""Rows of a scan as line integrals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.inputs.detector_rows import DetectorRows, live_ends, read_rows, runs
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct.preprocess.flatfield import (
    Attenuation,
    attenuation,
    attenuation_without_flats,
    joined,
    without_masked,
    without_stuck,
)


def read_attenuation(scan: ScanFile, start: int, stop: int) -> Attenuation:
    """Line integrals of some detector rows, less what the scan's background bins see.

    Pixels that are dead or masked are filled from the bins beside them, and up to three dead rows
    side by side from the rows beside them.

    Raises:
        NonFiniteError: a sample is not finite; the sentence names the file, view, row and bin.
        InputError: the rows cannot be read or corrected.
    """
    rows = read_rows(scan, start, stop)
    integrals = without_stuck(_between_live(scan, rows, start), scan.angles)
    if scan.background:
        subtract_background(integrals.projections, scan.background)
    return integrals


def _between_live(scan: ScanFile, rows: DetectorRows, start: int) -> Attenuation:
    """Line integrals of rows; those of dead ones are between the nearest that are not."""
    if not rows.lost.any():
        return _integrals(scan, rows, start)
    pieces = []
    for first, stop in runs(rows.lost):
        ends = live_ends(scan, start + first, start + stop) if rows.lost[first] else None
        if ends is None and rows.masked[first].all():
            raise NonFiniteError(
                f"{scan.path}: row {start + first} holds no number in any view, nor do enough of "
                "the rows beside it: choose other rows (--rows on a command line)"
            )
        if ends is None:
            pieces.append(_integrals(scan, rows.part(first, stop), start + first))
        else:
            pieces.append(_between(scan, ends, start + first, start + stop))
    return joined(pieces)


def _between(scan: ScanFile, ends: tuple[int, int], first: int, stop: int) -> Attenuation:
    """Rows ``first`` to ``stop`` that were filled linearly between two others."""
    lines = [
        without_stuck(_integrals(scan, read_rows(scan, row, row + 1), row), scan.angles).projections
        for row in ends
    ]
    dead = np.arange(first, stop)
    share = ((dead - ends[0]) / (ends[1] - ends[0])).astype(np.float32)[:, None]
    filled = (1 - share) * lines[0] + share * lines[1]
    bins = np.full(len(dead), scan.shape[2])
    return Attenuation(filled, bins, np.zeros_like(bins), dead_rows=tuple(map(int, dead)))


def _integrals(scan: ScanFile, rows: DetectorRows, start: int) -> Attenuation:
    """Line integrals of rows that follow each other.

    Raises:
        InputError: they cannot be corrected; the sentence names the file.
    """
    frames = rows.frames
    try:
        if scan.kind == "attenuation":
            return without_masked(frames.projections, rows.masked, first_row=start)
        if frames.flats is None:
            return attenuation_without_flats(
                frames.projections,
                frames.darks,
                incident=scan.incident,
                masked=rows.masked,
                first_row=start,
            )
        # Masked pixels are 0 in flats and darks alike, which is dead.
        return attenuation(
            frames.projections, frames.flats, frames.darks, flats_at=scan.flats_at, first_row=start
        )
    except InputError as error:
        raise type(error)(f"{scan.path}: {error}") from error


def subtract_background(projections: NDArray[np.float32], bins: int) -> None:
    """Bring the mean of the outermost bins of both ends to zero, in every row of every view.

    Args:
        projections: line integrals (angle, row, bin); changed in place.
        bins: at each end.
    """
    ends = np.concatenate([projections[..., :bins], projections[..., -bins:]], axis=-1)
    offset = ends.mean(axis=-1, keepdims=True, dtype=np.float64)
    projections -= offset.astype(np.float32)


def chosen_rows(wanted: tuple[int, int] | None, scan: ScanFile) -> tuple[int, int]:
    """The detector rows that are asked for, all if none are.

    Raises:
        InputError: there are no such rows.
    """
    rows = wanted or (0, scan.shape[1])
    if not 0 <= rows[0] < rows[1] <= scan.shape[1]:
        raise InputError(
            f"--rows is {rows[0]} {rows[1]}, {scan.path} has the rows 0 to {scan.shape[1] - 1}: "
            f"give the first and the one after the last, {scan.shape[1]} at most"
        )
    return rows


def check_center(center: float | None, scan: ScanFile) -> None:
    """Make sure that a rotation axis lies on the detector: else no point is seen all round.

    Raises:
        InputError: it does not.
    """
    bins = scan.shape[2]
    if center is not None and not -0.5 <= center <= bins - 0.5:
        raise InputError(
            f"--center is {center:g}, off the detector of {scan.path}, which has the bins 0 to "
            f"{bins - 1}"
        )
