"""Rows of a detector that show the object, for scans of which most rows show air.

What stays the same in all views is no object but the beam or a ring, and so is what a whole row of
a view has more. What is left changes from bin to bin by noise alone where there is air, and so has
no covariance of neighbouring bins there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Views = NDArray[np.float32]
# Gives (view, row, bin), line integrals but for what all views share, of some views and rows.
Look = Callable[[list[int], list[int]], Views]

# Views and rows that are looked at, at most.
_VIEWS, _ROWS = 24, 64
# A row shows the object where its views change by so large a share of the most that any do.
_SHARE = 0.1


def evenly(count: int, most: int) -> list[int]:
    """Some of so many numbers, evenly spaced, the middle one included where they are odd."""
    taken = min(most, count)
    return [int((index + 0.5) * count / taken) for index in range(taken)]


def rows_beside_air(
    usual: list[int], look: Look, views: int, within: tuple[int, int]
) -> list[int] | None:
    """Rows that show the object, where most of the usual ones show air.

    Args:
        usual: rows of an even choice.
        look: gives some rows of some views.
        views: how many there are.
        within: the first row that may be chosen and the one after the last.

    Returns:
        As many rows as usual or fewer, ascending; None where most of the usual ones show it.
    """
    first, stop = within
    among = [first + row for row in evenly(stop - first, _ROWS)]
    rows = sorted({*usual, *among})
    changes = _changes(look(evenly(views, _VIEWS), rows))
    enough = _SHARE**2 * float(changes.max())
    showing = {row for row, shows in zip(rows, changes > enough, strict=True) if shows}
    shown = [row for row in among if row in showing]
    if not shown or 2 * len(showing.intersection(usual)) > len(usual):
        return None
    return [shown[index] for index in evenly(len(shown), len(usual))]


def _changes(seen: Views) -> NDArray[np.float64]:
    """(rows,) the covariance of neighbouring bins of what changes from view to view."""
    changes: NDArray[np.float64] = seen - seen.mean(axis=0, dtype=np.float64)
    changes -= changes.mean(axis=2, keepdims=True)
    products = changes[..., 1:] * changes[..., :-1]
    covariance: NDArray[np.float64] = products.mean(axis=(0, 2))
    return np.maximum(np.nan_to_num(covariance), 0)
