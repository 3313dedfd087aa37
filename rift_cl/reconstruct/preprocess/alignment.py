"""A rotation axis that is not a column of the detector: one centre for each row, or a tilt.

Filtered backprojection wants the axis at one bin in all rows. ``straightened`` moves each row
along its bins. ``upright`` turns the projections about a point of the axis by its tilt in the
detector's plane, which takes rows above and below (``tilt_halo``); for small tilts the rows move
by ``tan(tilt)`` times their distance, and the picture is sheared as well, which
``straightened`` leaves out: at the detector's ends, by ``sin(tilt)`` times half its width.

A turn is two readings along lines (E. Catmull and A. R. Smith, 3-D transformations of images in
scanline order, SIGGRAPH 1980): along the rows' direction first, then along the bins.

Both lose what any interpolation loses, the end of the spectrum: next to nothing of data whose
detector blurs by more than a bin, a decibel of perfectly sharp ones moved by half a bin. Where the
axis is the same in many rows, giving those rows their own centre loses nothing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import open_device
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import real_numbers
from rift_cl.reconstruct.preprocess.sinc_interpolation import TAPS, resampled

Stack = NDArray[np.float32]

# The place of a pivot is rounded to one over so many rows.
_FINE = 1 << 16
# Rows of the tallest detectors.
_TALL = 4096
# Degrees: more than a misaligned detector; beyond, the scan was meant to be another (laminography).
_MOST_TILT = 5.0


def straightened(
    projections: Stack, centers: ArrayLike, center: float, *, device: Device | None = None
) -> Stack:
    """Move every row along its bins, so that the axis of all of them is at one bin.

    Args:
        projections: (angle, row, bin), counts or line integrals.
        centers: bin of the rotation axis in each row.
        center: the bin at which it is to be.
        device: where to work; the default device if not given.

    Returns:
        As ``projections``. Beyond the detector its last bin goes on.

    Raises:
        ShapeError: there is not one centre for each row.
        InputError: a centre is not finite, or would move a row by the detector's width or more.
    """
    stack = _stack(projections)
    rows, bins = stack.shape[1:]
    axis = real_numbers(centers)
    if axis is None or axis.shape != (rows,):
        raise ShapeError(f"centers has shape {np.shape(centers)}, wanted one for each of {rows}")
    shift = axis - center
    if not (np.abs(shift) < bins).all():
        raise InputError(
            f"the rows' centres run from {axis.min():g} to {axis.max():g}, wanted {center:g}, "
            f"which moves rows by more than the detector's {bins} bins"
        )
    shifts = np.repeat(shift[:, None], bins, axis=1)
    return resampled(device or open_device(), stack, shifts, along="bins")


def upright(
    projections: Stack,
    tilt: float,
    center: float,
    *,
    pivot: float,
    rows: tuple[int, int] | None = None,
    aspect: float = 1.0,
    device: Device | None = None,
) -> Stack:
    """Turn every projection about a point of the axis, so that the axis is a column.

    Args:
        projections: (angle, row, bin), counts or line integrals.
        tilt: of the axis in radians; positive where its bin grows with the row, by ``tan(tilt)``
            bins from one row of square pixels to the next.
        center: bin of the rotation axis at the row ``pivot``, before and after.
        pivot: row of these projections, which may be between rows or beyond them.
        rows: first row to return, and the one after the last; all if not given. Rows that are
            missing above or below repeat the last there is: read ``tilt_halo`` more.
        aspect: distance between rows over that between bins, 1 of square pixels.
        device: where to work; the default device if not given.

    Returns:
        (angle, row, bin), of the rows asked for.

    Raises:
        InputError: the tilt is no angle or more than ``most_tilt``, the aspect not positive, or
            there are no such rows.
    """
    stack = _stack(projections)
    first, stop = (0, stack.shape[1]) if rows is None else rows
    if not 0 <= first < stop <= stack.shape[1]:
        raise InputError(f"rows is {rows}, the projections have the rows 0 to {stack.shape[1]}")
    sine, cosine = math.sin(_checked(tilt, aspect)), math.cos(tilt)
    per_bin, per_row = sine / aspect, sine * aspect
    device = device or open_device()
    # Rounded so that the distance of a row is the same number in every slab.
    v = np.arange(first, stop)[:, None] - round(pivot * _FINE) / _FINE
    u = np.arange(stack.shape[2])[None] - float(center)
    sheared = resampled(
        device, stack, (v - u * per_bin) / cosine - v, along="rows", first_row=first
    )
    return resampled(device, sheared, u * cosine + v * per_row - u, along="bins")


def tilt_halo(
    tilt: float,
    bins: int,
    center: float | None = None,
    *,
    away: float = _TALL,
    aspect: float = 1.0,
) -> int:
    """Rows that ``upright`` takes above and below those that it returns.

    Args:
        tilt: in radians.
        bins: of a row.
        center: bin of the rotation axis; the middle if not given.
        away: how many rows from the pivot a row may be.
        aspect: as for ``upright``.

    Raises:
        InputError: the tilt is no angle or more than ``most_tilt``, or the aspect not positive.
    """
    middle = (bins - 1) / 2 if center is None else center
    reach = max(abs(middle), abs(bins - 1 - middle))
    sine, cosine = math.sin(abs(_checked(tilt, aspect))), math.cos(tilt)
    return math.ceil((reach * sine / aspect + away * (1 - cosine)) / cosine) + TAPS // 2 + 1


def most_tilt(aspect: float = 1.0) -> float:
    """The greatest tilt that is turned, in degrees: 5, of flat pixels less.

    A line across the detector crosses as many rows as it may of square pixels.

    Args:
        aspect: as for ``upright``.

    Raises:
        InputError: the aspect is not positive.
    """
    if not 0 < aspect < math.inf:
        raise InputError(
            f"the aspect is {aspect:g}, wanted the distance between rows over that between bins"
        )
    if aspect >= 1:
        return _MOST_TILT
    return math.degrees(math.atan(aspect * math.tan(math.radians(_MOST_TILT))))


def _checked(tilt: float, aspect: float) -> float:
    most = most_tilt(aspect)
    if not abs(tilt) <= math.radians(most):
        raise InputError(
            f"the tilt is {tilt:g} radians, wanted at most {math.radians(most):.3g} ({most:.3g} "
            "degrees): turn the detector, or the camera's picture"
        )
    return float(tilt)


def _stack(projections: Stack) -> Stack:
    if np.ndim(projections) != 3:
        raise ShapeError(
            f"projections have shape {np.shape(projections)}, wanted (angle, row, bin)"
        )
    return np.asarray(projections, np.float32)
