"""Images at other pixels: without the distortion of a lens, or smaller by a whole factor.

Both average what they are given, so that it has to be linear light with alpha multiplied in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry.lens_distortion import Lens

Image = NDArray[np.float32]

# Pixels that are looked up at a time, so that their coordinates take little memory.
_AT_ONCE = 1 << 16


def undistorted(image: Image, lens: Lens) -> Image:
    """What a pinhole with the intrinsics of the lens would have seen; bilinear interpolation.

    Args:
        image: (y, x, channel) through the lens.
        lens: the lens.

    Returns:
        An image of the same shape, 0 in every channel where the photograph does not reach.
    """
    high, wide, _ = image.shape
    found = np.zeros_like(image)
    rows = max(1, _AT_ONCE // wide)
    x = np.arange(wide) + 0.5
    for start in range(0, high, rows):
        y = np.arange(start, min(start + rows, high)) + 0.5
        points = np.stack(np.broadcast_arrays(x, y[:, np.newaxis]), axis=-1)
        places = lens.distort(points)
        # NaN is nowhere, and neither is it inside.
        inside = ((places >= 0) & (places <= (wide, high))).all(axis=-1)
        found[start : start + rows][inside] = _interpolated(image, places[inside] - 0.5)
    return found


def shrunk(image: Image, factor: int) -> Image:
    """The means of blocks of ``factor`` x ``factor`` pixels; blocks that are not full are left."""
    if factor == 1:
        return image
    high, wide, channels = (image.shape[0] // factor, image.shape[1] // factor, image.shape[2])
    blocks = image[: high * factor, : wide * factor].reshape(high, factor, wide, factor, channels)
    means: Image = blocks.mean(axis=(1, 3), dtype=np.float32)
    return means


def _interpolated(image: Image, places: NDArray[np.float64]) -> Image:
    """Pixels at places (n, 2) counted from pixel centres; the outer half pixel repeats its edge."""
    high, wide, channels = image.shape
    pixels = image.reshape(-1, channels)
    x, y = np.clip(places[:, 0], 0, wide - 1), np.clip(places[:, 1], 0, high - 1)
    left, top = x.astype(np.intp), y.astype(np.intp)
    right, below = np.minimum(left + 1, wide - 1), np.minimum(top + 1, high - 1)
    across = (x - left).astype(np.float32)[:, np.newaxis]
    down = (y - top).astype(np.float32)[:, np.newaxis]
    upper = pixels[top * wide + left] * (1 - across) + pixels[top * wide + right] * across
    lower = pixels[below * wide + left] * (1 - across) + pixels[below * wide + right] * across
    result: Image = upper * (1 - down) + lower * down
    return result
