"""Projections of an object that is wider than the detector, continued beyond its ends.

A filter along the detector takes a projection that ends abruptly for an edge of the object: the
slice grows bright towards the border of the field of view. Continued by its last value, which
falls off smoothly to zero, the projection has no such edge (Ohnesorge et al., Efficient
correction for CT image artifacts caused by objects extending outside the scan field of view,
Medical Physics 27, 39, 2000, from which it differs by the plainer continuation). What lies beyond
stays unknown, so that the level inside is right only up to a slow change.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan, Parallel

Stack = NDArray[np.float32]
Beam = TypeVar("Beam", bound=Parallel | Fan | Cone)

# Bins at each end whose mean is the value that is continued, as a share of the detector.
_END = 0.01
# Ends above this share of the strongest line integrals mean that the object goes on.
_TRUNCATED = 0.05
_STRONG = 99.0


def is_truncated(projections: Stack, center: float | None = None) -> bool:
    """Whether most views end above zero on one side, as those of too wide an object do.

    Rows that show air have no say.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin), air at 0.
        center: bin of an axis that is near one side, in a full turn: what views miss beyond that
            side others show, and the farther side alone counts. Both sides count if not given.
    """
    projections = _showing(projections)
    strong = float(np.percentile(projections, _STRONG))
    ends = [float(np.median(end)) for end in _ends(projections)]
    if center is not None:
        ends = [ends[int(center < (projections.shape[-1] - 1) / 2)]]
    return strong > 0 and max(ends) > _TRUNCATED * strong


def goes_on(row: Stack, middle: Stack) -> bool:
    """Whether the object is as long as to be seen in a row, in most views.

    Args:
        row: line integrals (angle, bin) of the first or the last row, air at 0.
        middle: those of a row in the middle.
    """
    beside, within = (float(_level(each)) for each in (row, middle))
    return within > 0 and beside > _TRUNCATED * within


def extended(projections: Stack, scan: Beam, *, bins: int | None = None) -> tuple[Stack, Beam]:
    """Continue every view on both sides by its last value, which falls off to zero.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin).
        scan: their geometry, parallel, a fan or a cone.
        bins: added on each side; the detector's own width if not given.

    Returns:
        The longer projections and their geometry; the rotation axis stays where it is.

    Raises:
        InputError: ``bins`` is negative.
    """
    stack = np.asarray(projections, np.float32)
    added = stack.shape[-1] if bins is None else bins
    if added < 0:
        raise InputError(f"bins is {added}, wanted 0 or more to add on each side")
    if added == 0:
        return stack, scan
    # 1 next to the detector, 0 at the far end, level at both.
    fall = (0.5 + 0.5 * np.cos(np.pi * (np.arange(added) + 0.5) / added)).astype(np.float32)
    left, right = (end[..., None] for end in _ends(stack))
    longer = np.concatenate([left * fall[::-1], stack, right * fall], axis=-1)
    return longer, wider(scan, added, added)


def wider(scan: Beam, before: int, after: int) -> Beam:
    """The scan with so many more bins before the first of its detector and after the last."""
    bins = scan.bins + before + after
    if isinstance(scan, Cone):
        row, bin = scan.center
        return replace(scan, bins=bins, center=(row, bin + before))
    return replace(scan, bins=bins, center=scan.center + before)


def _showing(projections: Stack) -> Stack:
    """The rows that show the object in most views; all where none stands out."""
    if projections.ndim == 2:
        return projections
    levels = _level(projections)
    shown = levels > _TRUNCATED * levels.max()
    return projections if shown.all() or not shown.any() else projections[:, shown]


def _level(projections: Stack) -> NDArray[np.float64]:
    """The mean line integral of a row in most views, () of one row and (row,) of more."""
    levels: NDArray[np.float64] = np.median(projections.mean(axis=-1, dtype=np.float64), axis=0)
    return levels


def _ends(projections: Stack) -> tuple[Stack, Stack]:
    count = max(1, round(_END * projections.shape[-1]))
    first: Stack = projections[..., :count].mean(axis=-1, dtype=np.float64).astype(np.float32)
    last: Stack = projections[..., -count:].mean(axis=-1, dtype=np.float64).astype(np.float32)
    return first, last
