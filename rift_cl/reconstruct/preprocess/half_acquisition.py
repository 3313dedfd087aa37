"""Half acquisition: a full turn about an axis near the detector's end, joined to a half turn.

The view at angle ``a + pi`` sees every line of the view at ``a`` from behind, at -t. Mirrored and
put beside it, the two make one view nearly twice as wide; where both see the same lines they are
blended with weights that go smoothly from one to the other (as ``offset_axis.offset_weights``).
The joined sinogram is one of a half turn, which everything else takes as it is: ring removal,
solvers, other programs. Filtered backprojection alone has no need of it: ``fbp`` weighs the rays of
such a turn itself (``offset_axis``), which gives the same slices without reading between samples.

Where no view looks exactly the opposite way, views next to it are interpolated in angle; where
twice the axis' bin is no whole number, the mirrored bins are read between samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import open_device
from rift_cl.errors import InputError, ShapeError, checked_flag
from rift_cl.geometry import Parallel
from rift_cl.reconstruct.direct.offset_axis import is_full_turn, offset_weights
from rift_cl.reconstruct.preprocess.sinc_interpolation import resampled

Floats = NDArray[np.float64]
Stack = NDArray[np.float32]

# Angles closer than this are the same, in radians.
_SAME = 1e-6
# Mirrored bins closer to the others than this need not be read between samples.
_SAME_BIN = 1e-3
# The narrowest gap between four views, as a share of the widest, at which a cubic goes through.
_EVEN = 0.4


def stitched(
    projections: Stack, scan: Parallel, *, level: bool = False, device: Device | None = None
) -> tuple[Stack, Parallel]:
    """Join opposite views of a full turn to views nearly twice as wide, of half a turn.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin), views in any order; views
            that repeat an angle are averaged.
        scan: their geometry; the rotation axis is on the detector, near either end.
        level: bring opposite views to the same mean where they overlap, half of the difference
            each, for a beam that faded during the scan; over all rows that are given, together.
        device: where bins are read between samples; the default device if not given.

    Returns:
        The joined projections, with the same axes, and their geometry. They begin with the first
        view's direction; of an odd number of views one more than half are left.

    Raises:
        ShapeError: the projections do not fit the scan.
        InputError: the views are no full turn, or the axis is not on the detector.
    """
    stack = np.asarray(projections, np.float32)
    if stack.ndim not in (2, 3) or (len(stack), stack.shape[-1]) != (len(scan.angles), scan.bins):
        raise ShapeError(
            f"projections have shape {stack.shape}, wanted ({len(scan.angles)}, {scan.bins}) or "
            f"({len(scan.angles)}, row, {scan.bins})"
        )
    checked_flag("stitched", "level", level)
    if not is_full_turn(scan.angles):
        raise InputError("the views are no full turn: only opposite views can be joined")
    weights = (offset_weights(scan) / 2).astype(np.float32)
    angles, views = _in_one_turn(scan.angles, stack)
    # Looked at from behind, a detector whose lower bins reach further is one whose higher ones do.
    behind = 2 * scan.center > scan.bins - 1
    center = scan.bins - 1 - scan.center if behind else scan.center
    if behind:
        views, weights = views[..., ::-1], weights[::-1]
    own, opposite = _opposite(views, angles)
    opposite, first = _mirrored(opposite, center, device)
    if level:
        _bring_to_one_mean(own, opposite, first)
    wide = _blended(own, opposite, weights, first)
    center -= first
    if behind:
        wide, center = np.ascontiguousarray(wide[..., ::-1]), wide.shape[-1] - 1 - center
    directions = scan.angles[0] + angles[: len(wide)]
    return wide, Parallel(directions, wide.shape[-1], scan.pitch, center)


def _in_one_turn(angles: Floats, stack: Stack) -> tuple[Floats, Stack]:
    """Distinct angles from the first view's on, ascending, and their views; equal ones averaged."""
    turned = np.mod(angles - angles[0] + _SAME, 2 * np.pi) - _SAME
    order = np.argsort(turned, kind="stable")
    starts = np.flatnonzero(np.diff(turned[order], prepend=-np.inf) > _SAME)
    if starts.size == angles.size:
        return turned[order], stack[order]
    groups = np.split(order, starts[1:])
    means = [stack[group].mean(axis=0, dtype=np.float64) for group in groups]
    return turned[order][starts], np.asarray(means, np.float32)


def _opposite(views: Stack, angles: Floats) -> tuple[Stack, Stack]:
    """The views of the first half turn, and those from the opposite side, interpolated in angle.

    By the cubic through the four views about the angle where they are about evenly spaced, by a
    straight line where they are not.
    """
    # A view that lies half a step or less before half a turn is the first one's opposite.
    half = int(np.searchsorted(angles, np.pi - np.median(np.diff(angles)) / 4))
    circle = np.concatenate([angles[-2:] - 2 * np.pi, angles, angles[:2] + 2 * np.pi])
    numbers = np.arange(-2, len(angles) + 2) % len(angles)
    opposite = np.empty_like(views[:half])
    for view in range(half):
        wanted = angles[view] + np.pi
        after = int(np.searchsorted(circle, wanted))
        nearest = after if circle[after] - wanted < wanted - circle[after - 1] else after - 1
        if abs(circle[nearest] - wanted) <= _SAME:
            opposite[view] = views[numbers[nearest]]
            continue
        four = slice(after - 2, after + 2)
        gaps = np.diff(circle[four])
        used = four if gaps.min() >= _EVEN * gaps.max() else slice(after - 1, after + 1)
        shares = _lagrange(circle[used], wanted).astype(np.float32)
        opposite[view] = np.tensordot(shares, views[numbers[used]], 1)
    return views[:half].copy(), opposite


def _lagrange(nodes: Floats, place: float) -> Floats:
    """Weights of values at the nodes in the polynomial through them."""
    apart = nodes[:, None] - nodes
    away = np.broadcast_to(place - nodes, apart.shape)
    np.fill_diagonal(apart, 1)
    ratios = away / apart
    np.fill_diagonal(ratios, 1)
    weights: Floats = ratios.prod(axis=1)
    return weights


def _mirrored(views: Stack, center: float, device: Device | None) -> tuple[Stack, int]:
    """Views turned round about the axis, and the bin of the others at which they begin."""
    bins = views.shape[-1]
    # Mirrored bin n lies at 2 center - (bins - 1) + n.
    begin = 2 * center - (bins - 1)
    first = int(np.ceil(begin - _SAME_BIN))
    turned = views[..., ::-1]
    if first - begin <= _SAME_BIN:
        return turned, first
    shifts = np.full((1, bins), first - begin)
    lines = np.ascontiguousarray(turned).reshape(-1, 1, bins)
    moved = resampled(device or open_device(), lines, shifts, along="bins")
    return moved.reshape(views.shape), first


def _bring_to_one_mean(own: Stack, opposite: Stack, first: int) -> None:
    """Share the mean difference of the two, where they see the same lines, between them."""
    overlap = opposite.shape[-1] + first
    difference = own[..., :overlap] - opposite[..., -first:]
    offset = difference.mean(axis=tuple(range(1, own.ndim)), keepdims=True, dtype=np.float64)
    own -= (offset / 2).astype(np.float32)
    opposite += (offset / 2).astype(np.float32)


def _blended(own: Stack, opposite: Stack, weights: Stack, first: int) -> Stack:
    bins = own.shape[-1]
    wide = np.empty((*own.shape[:-1], bins - first), np.float32)
    wide[..., :-first] = opposite[..., :-first]
    overlap = bins + first
    w = weights[:overlap]
    wide[..., -first:bins] = w * own[..., :overlap] + (1 - w) * opposite[..., -first:]
    wide[..., bins:] = own[..., overlap:]
    return wide
