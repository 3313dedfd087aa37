"""Fan-beam views resampled to parallel ones, so that every parallel method serves fan scans.

The ray that leaves the central one by the fan angle ``gamma`` in the view at angle ``a`` is the
ray of a parallel scan at ``theta = a - gamma`` with ``t = source_to_axis * sin(gamma)`` (Kak and
Slaney, section 3.4.1). A parallel view is kept where the scan has all of its rays, directly or,
once views go half round, from the opposite side: ``(theta + pi, -t)`` is the same line. Views that
are covered only in part, at the ends of a limited scan, are left out, since a filter takes what
is missing for air; a method that explains rays one by one can use them (``whole=False``).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.host_arrays import check_finite
from rift_cl.errors import InputError, ShapeError, checked_flag
from rift_cl.geometry import Parallel
from rift_cl.geometry.fan import FanBeam
from rift_cl.reconstruct.direct.turn_views import (
    TurnViews,
    in_one_turn,
    means,
    resampled,
    turn_views,
)

Floats = NDArray[np.float64]
Stack = NDArray[np.float32]
Interpolation = Literal["linear", "cubic"]

_ORDERS = {"linear": 1, "cubic": 3}
# A view of which less is covered is not worth its place.
_LEAST_COVERED = 0.1
# Rays beyond the ends of a scan by this share of a step are still taken.
_SLACK = 1e-3


def rebin_fan(
    projections: Stack,
    angles: Floats,
    fan: FanBeam,
    *,
    interpolation: Interpolation = "cubic",
    whole: bool = True,
) -> tuple[Stack, Parallel]:
    """Resample fan-beam views to a parallel sinogram.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin); rows are alike where the
            fan is flat.
        angles: the views' angles in radians, any order, as ``FanBeam`` counts them.
        fan: source and detector.
        interpolation: between views and between bins.
        whole: only views with all of their rays; else those with some as well, with zeros where
            ``covered_rays`` is False.

    Returns:
        The parallel projections, with the same axes, and their geometry: its lengths are in the
        fan's unit, bins are as far apart as the fan's rays at the rotation axis, and angles are
        about as far apart as the fan's views.

    Raises:
        ShapeError: the arrays do not fit each other.
        InputError: the interpolation is unknown, or no parallel view is covered.
    """
    checked_flag("rebin_fan", "whole", whole)
    stack = np.asarray(projections, np.float32)
    if stack.ndim not in (2, 3) or stack.shape[0] != np.size(angles):
        raise ShapeError(
            f"projections have shape {stack.shape}, wanted ({np.size(angles)}, bin) or "
            f"({np.size(angles)}, row, bin)"
        )
    if interpolation not in _ORDERS:
        raise InputError(f"interpolation is {interpolation!r}, wanted linear or cubic")
    check_finite(stack, name="projections")
    turned, group = in_one_turn(angles)
    scan, _ = covered_rays(turned, stack.shape[-1], fan, whole=whole)
    stack = means(stack, group) if len(turned) < len(group) else stack[np.argsort(group)]
    views, order = turn_views(turned), _ORDERS[interpolation]
    ways = _readings(views, scan, fan, stack.shape[-1])
    seen = np.maximum(sum(weight for _, weight in ways), 1)
    places = [(place, weight / seen) for place, weight in ways if weight.any()]
    rows = stack[:, None] if stack.ndim == 2 else stack
    out = np.empty((len(scan.angles), rows.shape[1], scan.bins), np.float32)
    for row in range(rows.shape[1]):
        out[:, row] = resampled(rows[views.order, row], places, order)
    return (out[:, 0] if stack.ndim == 2 else out), scan


def covered_rays(
    angles: Floats, bins: int, fan: FanBeam, *, whole: bool = True
) -> tuple[Parallel, NDArray[np.bool_]]:
    """The parallel scan to which a fan scan is resampled, and which of its rays are covered.

    Args:
        angles: the fan views' angles in radians.
        bins: bins of the fan's detector.
        fan: source and detector.
        whole: only views with all of their rays.

    Returns:
        The geometry, and (angle, bin) whether a ray is covered.

    Raises:
        InputError: the views are fewer than two, or cover no parallel view.
    """
    views = turn_views(in_one_turn(angles)[0])
    gamma = fan.fan_angles(bins)
    pitch = fan.pitch / fan.magnification
    low, high = fan.source_to_axis * np.sin(gamma[[0, -1]]) / pitch
    if views.turn:
        # What one side does not reach, the other sees from behind.
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    first, last = int(np.ceil(low - 1e-9)), int(np.floor(high + 1e-9))
    # Half a turn, evenly divided: each direction once, about the middle of the views.
    count = max(1, round(np.pi / views.step))
    middle = (views.first + views.last) / 2 - gamma.mean()
    directions = np.arange(count) * np.pi / count
    if not views.turn:
        directions += middle - directions.mean()
    scan = Parallel(directions, last - first + 1, pitch, -first)
    seen: NDArray[np.bool_] = np.any(
        [weight > 0 for _, weight in _readings(views, scan, fan, bins)], axis=0
    )
    covered = seen.all(axis=1) if whole else seen.mean(axis=1) >= _LEAST_COVERED
    if not covered.any():
        raise InputError(
            f"the views span {np.rad2deg(views.last - views.first):.3g} degrees, the fan "
            f"{np.rad2deg(np.ptp(gamma)):.3g}: no parallel view is covered; the object has to be "
            "looked at from more directions"
        )
    return Parallel(directions[covered], scan.bins, pitch, -first), seen[covered]


def _readings(
    views: TurnViews, scan: Parallel, fan: FanBeam, bins: int
) -> list[tuple[Floats, Floats]]:
    """(view, bin) at which every parallel ray may be read, and 1 where there is such a reading.

    A ray is read directly and from the opposite side, each in any turn.
    """
    gamma = np.arcsin(np.clip(scan.coordinates() / fan.source_to_axis, -1, 1))
    theta = scan.angles[:, None]
    slack = 0.0 if views.turn else _SLACK * views.step
    ways = []
    for ray, side in ((theta + gamma, gamma), (theta + np.pi - gamma, -gamma)):
        bin = fan.center + fan.source_to_detector * np.tan(side) / fan.pitch
        seen = (bin >= -_SLACK) & (bin <= bins - 1 + _SLACK)
        for turns in (-1, 0, 1):
            angle = ray + 2 * np.pi * turns
            inside = seen & (angle >= views.first - slack)
            inside &= angle < views.last if views.turn else angle <= views.last + slack
            view = np.interp(angle, views.angles, np.arange(views.angles.size))
            place = np.stack([view, np.broadcast_to(bin, view.shape)])
            ways.append((place, inside.astype(np.float64)))
    return ways
