"""The two planes of an image: by rows, for the views that are walked along x, and by columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def split(image: Array, *, margin: int, transpose: bool) -> Array:
    """The plane (slices, rows, margin + width + margin) of a volume, zero in its margins."""
    plane = image.swapaxes(1, 2) if transpose else image
    return np.pad(plane, ((0, 0), (0, 0), (margin, margin)))


def merge(by_rows: Array, by_columns: Array, *, ny: int, nx: int) -> Array:
    """The volume (slices, ny, nx) of two planes whose rows may be padded at their ends."""
    return by_rows[:, :, :nx] + by_columns[:, :, :ny].swapaxes(1, 2)
