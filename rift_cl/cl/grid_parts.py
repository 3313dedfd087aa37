"""Cutting a grid of work-items into parts that are launched one after the other.

A part is launched with an offset, so that ``get_global_id`` counts as in the whole grid, and its
results have the same bits. What kernels may not ask for then is said in
``kernels/include/portable.h``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

Size = tuple[int, ...]


class GridPart(NamedTuple):
    """So many work-items along each axis, from ``offset`` on."""

    offset: Size
    size: Size


def grid_parts(size: Size, most: Sequence[int], group: int) -> list[GridPart]:
    """Cut a grid into parts that are no longer than the device takes.

    Args:
        size: work-items along each axis; whole groups along the first.
        most: work-items of a part along each axis; a part has one group at least.
        group: work-items of a group, which lies along the first axis.
    """
    steps = [max(group, most[0] // group * group), *most[1:]]
    starts = [range(0, length, step) for length, step in zip(size, steps, strict=False)]
    parts = []
    for offset in itertools.product(*starts):
        along = zip(offset, steps, size, strict=False)
        parts.append(GridPart(offset, tuple(min(step, n - at) for at, step, n in along)))
    return parts
