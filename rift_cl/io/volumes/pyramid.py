"""Coarser copies of a volume, each of half the samples along its long axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Shape = tuple[int, ...]

# Copies end where no axis is longer than this,
_SMALL = 256
# and axes that are this short stay as they are, so that a few slices do not melt into one.
_SHORT = 64


def coarser_shapes(shape: Shape) -> list[tuple[Shape, Shape]]:
    """Shape of each coarser copy, and by how much it is coarser than the one before, by axis.

    Args:
        shape: (z, y, x) of the volume.
    """
    copies = []
    while max(shape) > _SMALL:
        factors = tuple(2 if n > _SHORT else 1 for n in shape)
        shape = tuple(-(-n // f) for n, f in zip(shape, factors, strict=True))
        copies.append((shape, factors))
    return copies


def halved(block: NDArray[Any], factors: Shape) -> NDArray[Any]:
    """Means of neighbouring pairs along the axes whose factor is 2.

    A last sample without a neighbour stays as it is. Integers are rounded to the nearest (ties to
    the even one), after the last axis.
    """
    means = block.astype(np.float32)
    for axis, factor in enumerate(factors):
        if factor == 2:
            means = _halved_axis(means, axis)
    if block.dtype.kind in "iu":
        np.rint(means, out=means)
    return means.astype(block.dtype)


def _halved_axis(block: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    count = block.shape[axis]
    pairs = count // 2
    means = np.empty((*block.shape[:axis], count - pairs, *block.shape[axis + 1 :]), np.float32)
    along = (slice(None),) * axis
    first, second = (block[(*along, slice(start, 2 * pairs, 2))] for start in (0, 1))
    both = means[(*along, slice(pairs))]
    np.add(first, second, out=both)
    both *= np.float32(0.5)
    means[(*along, slice(pairs, None))] = block[(*along, slice(2 * pairs, None))]
    return means
