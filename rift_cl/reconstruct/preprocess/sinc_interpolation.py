"""Projections read between samples, along rows or bins, by a windowed sinc on the device.

Twelve taps under a Kaiser window lose as little as the Fourier transform, to a few hundredths of a
decibel in a slice, and less than cubic splines. What any of them loses is the very
last of the spectrum: half a bin from its samples, a pattern that alternates from bin to bin cannot
be read. The formula is ``rift_cl/reference/resample.py``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device

Floats = NDArray[np.float64]
Stack = NDArray[np.float32]

TAPS = 12
_KAISER = 7.0
# Bins that share where their taps start, on every device.
_BLOCK = 8
# Bytes of projections on the device at a time, and views: grids of some GPUs end at 65,535.
_CHUNK, _VIEWS = 1 << 26, 1 << 15


def sinc_weights(fractions: Floats) -> Floats:
    """Weights of the twelve samples about a place, for its distance past the sixth of them.

    Args:
        fractions: any shape, from 0 to 1.

    Returns:
        (..., 12), adding up to one.
    """
    distance = np.arange(1 - TAPS // 2, TAPS // 2 + 1) - np.asarray(fractions)[..., None]
    share = np.clip(1 - (2 * distance / TAPS) ** 2, 0, None)
    weights: Floats = np.sinc(distance) * np.i0(_KAISER * np.sqrt(share))
    weights /= weights.sum(axis=-1, keepdims=True)
    return weights


def resampled(
    device: Device, stack: Stack, shifts: Floats, *, along: str, first_row: int = 0
) -> Stack:
    """Read every view between samples, at the same places.

    The result depends on the shifts alone and not on where in the stack a row is, so that rows
    come out the same to the bit in whatever slab they are.

    Args:
        device: where to work.
        stack: (view, row, bin).
        shifts: (row, bin) of the result: how far from itself each sample is read, in bins
            (along="bins") or in rows (along="rows"). From one bin to the next they change by less
            than a seventh of a sample. Beyond its ends the stack goes on with its last sample.
        along: "bins" or "rows".
        first_row: of the stack, the row that the result begins with.

    Returns:
        (view, row, bin).
    """
    views, rows_in, bins = stack.shape
    rows = len(shifts)
    weights, starts = _tables(shifts)
    if along == "rows":
        starts += first_row + np.arange(rows, dtype=np.int32)[:, None]
    tables = {"weights": device.array(weights), "starts": device.array(starts)}
    out = np.empty((views, rows, bins), np.float32)
    run = 4096 if device.traits.is_cpu else 1
    step = min(_VIEWS, max(1, _CHUNK // (4 * bins * max(rows_in, rows))))
    for start in range(0, views, step):
        source = device.array(np.ascontiguousarray(stack[start : start + step], np.float32))
        result = device.empty((source.shape[0], rows, bins))
        device.launch(
            "resample_lines",
            (-(-bins // run), source.shape[0], rows),
            stack=source,
            out=result,
            **tables,
            first_row=first_row,
            rows_in=rows_in,
            rows=rows,
            bins=bins,
            stride=weights.shape[-1],
            RUN=run,
            TAPS=TAPS + 1,
            ALONG_ROWS=int(along == "rows"),
        )
        out[start : start + step] = device.get(result)
    return out


def _tables(shifts: Floats) -> tuple[Stack, NDArray[np.int32]]:
    """Weights (row, tap, bin), and of each block of bins the first tap's distance (row, block).

    Places of a block that begin one sample later have their weights one tap further on.
    """
    rows, bins = shifts.shape
    padded = -(-bins // _BLOCK) * _BLOCK
    whole = np.floor(shifts)
    weights = sinc_weights(shifts - whole)
    first = whole.astype(np.int64) + 1 - TAPS // 2
    first = np.pad(first, ((0, 0), (0, padded - bins)), mode="edge")
    blocks = first.reshape(rows, -1, _BLOCK)
    starts = blocks.min(axis=-1)
    later = (blocks - starts[..., None]).reshape(rows, padded)[:, :bins]
    if later.max() > 1:
        raise ValueError("shifts change too fast from bin to bin")
    table = np.zeros((rows, TAPS + 1, padded), np.float32)
    lines = np.moveaxis(weights, -1, 1)
    table[:, :TAPS, :bins] = np.where(later[:, None] == 0, lines, 0)
    table[:, 1:, :bins] += np.where(later[:, None] == 1, lines, 0)
    return table, starts.astype(np.int32)
