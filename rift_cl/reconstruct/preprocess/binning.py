"""Means of neighbouring detector pixels: fewer samples, less noise, and the geometry that follows.

Counts are averaged before the logarithm: the mean of counts is what a coarser detector would have
counted, the mean of line integrals is not. Flats and darks are binned as the projections are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Parallel


def binned(frames: NDArray[Any], *, rows: int = 1, bins: int = 1) -> NDArray[np.float32]:
    """Means over blocks of detector rows and bins.

    Rows and bins at the far end that fill no block are left out; ``binning_note`` says how many.

    Args:
        frames: (..., row, bin), projections or flats or darks; integers or real numbers.
        rows: rows to a block.
        bins: bins to a block.

    Returns:
        (..., row // rows, bin // bins).

    Raises:
        InputError: a block has no row or no bin.
        ShapeError: not even one block fits.
    """
    _demand(rows, bins)
    high, wide = frames.shape[-2] // rows, frames.shape[-1] // bins
    if not (high and wide):
        raise ShapeError(
            f"frames of {frames.shape[-2]} rows and {frames.shape[-1]} bins are smaller than the "
            f"{rows} x {bins} of a block"
        )
    if rows == bins == 1:
        return np.asarray(frames, np.float32)
    total = np.zeros((*frames.shape[:-2], high, wide), np.float32)
    for row in range(rows):
        for bin in range(bins):
            total += frames[..., row : high * rows : rows, bin : wide * bins : bins]
    total /= rows * bins
    return total


def binned_center(center: float, bins: int) -> float:
    """The rotation axis in units of binned detector bins.

    Block j holds the bins ``bins j`` to ``bins j + bins - 1``, whose middle is
    ``bins j + (bins - 1) / 2``.
    """
    _demand(1, bins)
    return (center - (bins - 1) / 2) / bins


def binned_scan(scan: Parallel, bins: int) -> Parallel:
    """The geometry of projections whose bins were averaged in blocks.

    Raises:
        InputError: a block has no bin.
        ShapeError: not even one block fits.
    """
    center = binned_center(scan.center, bins)
    return Parallel(scan.angles, scan.bins // bins, scan.pitch * bins, center)


def binning_note(rows_of_detector: int, bins_of_detector: int, *, rows: int, bins: int) -> str:
    """What is left out because it fills no block, in words; empty if nothing is."""
    lost = {"row": rows_of_detector % rows, "bin": bins_of_detector % bins}
    parts = [f"the last {n} {what}{'s' * (n > 1)}" for what, n in lost.items() if n]
    return f"Binning leaves out {' and '.join(parts)} of the detector." if parts else ""


def _demand(rows: int, bins: int) -> None:
    for name, count in (("rows", rows), ("bins", bins)):
        if isinstance(count, bool) or int(count) != count or count < 1:
            raise InputError(f"binning: {name} is {count!r}, wanted a whole number, 1 or more")
