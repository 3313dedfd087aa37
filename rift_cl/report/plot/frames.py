"""Samples and photographs as JPEG files, small enough for a page that is mailed.

A figure is for axes and names; where a picture stands alone, its samples are the file's pixels, or
means over squares of them where they are too many.
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import ShapeError
from rift_cl.report.plot.figure import Reals, real_values

# Bytes that the pictures of one slider may take, and pixels along a side of the largest.
BUDGET, _SIDE = 2 << 20, 640
_QUALITY = 88
# Sizes that are tried until the pictures fit, each this share of the one before.
_SMALLER, _LEAST = 0.8, 96

_Window = tuple[float, float]


def jpeg(image: ArrayLike, *, window: _Window = (0.0, 1.0), side: int = 960) -> bytes:
    """One picture as the content of a JPEG file.

    Args:
        image: (y, x) samples, or (y, x, 3) colours from 0 to 1; row 0 is on top.
        window: samples that are black and white.
        side: most pixels along a side; larger pictures are made smaller by means.

    Raises:
        ShapeError: the image has other axes.
        DTypeError: it is not of real numbers.
        NonFiniteError: it holds NaN or infinity.
    """
    return _encoded(_codes(image, window), side)


def framed(
    images: Sequence[ArrayLike], *, window: _Window = (0.0, 1.0), budget: int = BUDGET
) -> tuple[list[bytes], tuple[int, int]]:
    """Pictures of one size as JPEG files that together take no more than a budget.

    Args:
        images: (y, x) or (y, x, 3) each, all alike; see ``jpeg``.
        window: samples that are black and white.
        budget: bytes of all files together; kept to unless that would leave nothing to see.

    Returns:
        The files' contents, and the height and width of each in pixels.

    Raises:
        ShapeError: there is no image, or their shapes differ.
        DTypeError: one is not of real numbers.
        NonFiniteError: one holds NaN or infinity.
    """
    codes = [_codes(image, window) for image in images]
    if not codes or len({image.shape for image in codes}) > 1:
        shapes = sorted({image.shape for image in codes})
        raise ShapeError(f"framed: images have shapes {shapes}, wanted one or more of one shape")
    side = min(_SIDE, max(codes[0].shape[:2]))
    files = [_encoded(image, side) for image in codes]
    while sum(map(len, files)) > budget and side * _SMALLER >= _LEAST:
        side = round(side * _SMALLER)
        files = [_encoded(image, side) for image in codes]
    return files, _fitted(codes[0].shape, side)


def _codes(image: ArrayLike, window: _Window) -> NDArray[np.uint8]:
    low, high = window
    values: Reals = real_values("image", image, axes=np.ndim(image))
    if values.ndim != 2 and values.shape[2:] != (3,):
        raise ShapeError(f"an image has shape {values.shape}, wanted (y, x) or (y, x, 3)")
    return np.rint(np.clip((values - low) / (high - low), 0, 1) * 255).astype(np.uint8)


def _fitted(shape: tuple[int, ...], side: int) -> tuple[int, int]:
    """Height and width with no more than ``side`` pixels along either."""
    factor = min(1.0, side / max(shape[:2]))
    return max(1, round(shape[0] * factor)), max(1, round(shape[1] * factor))


def _encoded(codes: NDArray[np.uint8], side: int) -> bytes:
    from PIL import Image

    high, wide = _fitted(codes.shape, side)
    image = Image.fromarray(codes)
    if (high, wide) != codes.shape[:2]:
        image = image.resize((wide, high), Image.Resampling.BOX)
    buffer = io.BytesIO()
    image.save(buffer, format="JPEG", quality=_QUALITY, subsampling=0)
    return buffer.getvalue()
