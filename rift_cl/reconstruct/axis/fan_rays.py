"""One row of a fan seen in two other ways: as parallel views, and from the opposite sides.

The ray that leaves the central one by ``gamma`` in the view at ``a`` is that of a parallel view at
``a - gamma``, ``source_to_axis * sin(gamma)`` from the axis. Where the assumed centre is off by a
small fan angle e, all directions are off by e, which no measure of the axis minds, and all
distances by nearly ``source_to_axis * e``: the parallel views then turn about another bin, and the
search for parallel axes finds it. Read so, no ray is taken from the opposite side, since that is
what is to be compared.

The same line is measured once more at ``a + pi - 2 gamma`` by the ray at ``-gamma``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Fan
from rift_cl.reconstruct.axis.views import Views
from rift_cl.reconstruct.direct.turn_views import (
    TurnViews,
    in_one_turn,
    means,
    resampled,
    turn_views,
)

Floats = NDArray[np.float64]

# How far apart, in radians, views may be between which the rays of parallel views are read.
_GAP = np.deg2rad(7.0)
# The same for opposite rays, which are compared one by one; or so many steps.
_NEAR, _STEPS = np.deg2rad(2.0), 2.5
# Rays beyond the ends of the scan, or of a row, by this share of a step still count.
_SLACK = 1e-6


def parallel_views(rows: Views, fan: Fan) -> tuple[Views, Floats, Floats]:
    """Parallel views of the rays as they were taken.

    Args:
        rows: line integrals, (view, row, bin), of rows that are fans.
        fan: their geometry as far as it is known.

    Returns:
        (direction, row, bin) the views that are covered as a whole; their directions in radians;
        and the fan's bin that each of their own bins comes from, increasing, as far apart as the
        fan's at the centre.

    Raises:
        InputError: no parallel view is covered.
    """
    turned, group = in_one_turn(fan.angles)
    views = turn_views(turned)
    gamma, reach = fan.fan_angles(), fan.source_to_axis
    step = fan.pitch / fan.magnification
    low, high = (reach * np.sin(gamma[[0, -1]]) / step).tolist()
    t = np.arange(np.ceil(low - _SLACK), np.floor(high + _SLACK) + 1) * step
    leaves = np.arcsin(t / reach)
    if views.turn:
        # An even number, so that every view has one exactly opposite.
        count = 2 * max(1, round(np.pi / views.step))
        theta = views.first + np.arange(count) * 2 * np.pi / count
    else:
        begin, end = views.first - leaves.min(), views.last - leaves.max()
        theta = np.arange(begin, end + _SLACK, views.step)
    ray = theta[:, None] + leaves
    covered = _between(views, ray, _GAP).all(axis=1)
    if not covered.any():
        raise InputError(
            f"the views span {np.rad2deg(views.last - views.first):.3g} degrees, the fan "
            f"{np.rad2deg(np.ptp(gamma)):.3g}: there is no direction of which every ray was taken"
        )
    stack = means(rows, group)[views.order]
    bins = bins_of(fan, leaves)
    places = _places(views, ray[covered], bins)
    parallel = [resampled(stack[:, row], [places], 3) for row in range(stack.shape[1])]
    return np.stack(parallel, axis=1), theta[covered], bins


def bins_of(fan: Fan, gamma: Floats) -> Floats:
    """Bins of a fan at fan angles, in radians."""
    away = gamma if fan.curved else np.tan(gamma)
    bins: Floats = fan.center + fan.source_to_detector / fan.pitch * away
    return bins


def opposite_rays(sinogram: Views, fan: Fan) -> tuple[Views, Views, NDArray[np.bool_]]:
    """Every ray, and the same line measured from the other side.

    Args:
        sinogram: line integrals of one row, (view, bin).
        fan: its geometry.

    Returns:
        (view, bin) the rays in ascending order of distinct views; what is read from their opposite
        sides; and where that was measured.
    """
    turned, group = in_one_turn(fan.angles)
    views = turn_views(turned)
    ascending = means(sinogram, group)
    gamma = fan.fan_angles()
    opposite = turned[:, None] + np.pi - 2 * gamma
    opposite = views.first + np.mod(opposite - views.first, 2 * np.pi)
    bins = 2 * fan.center - np.arange(fan.bins, dtype=np.float64)
    near = max(_NEAR, _STEPS * views.step)
    seen = _between(views, opposite, near) & (bins >= -_SLACK) & (bins <= fan.bins - 1 + _SLACK)
    place, _ = _places(views, opposite, bins)
    read = resampled(ascending[views.order], [(place, seen.astype(np.float64))], 3)
    return ascending, read, seen


def _between(views: TurnViews, angles: Floats, widest: float) -> NDArray[np.bool_]:
    """Whether rays at these angles of the source lie between views that are close enough."""
    slack = _SLACK * views.step
    if views.turn:
        angles = views.first + np.mod(angles - views.first, 2 * np.pi)
    after = np.clip(np.searchsorted(views.angles, angles - slack), 1, views.angles.size - 1)
    gap = views.angles[after] - views.angles[after - 1]
    inside = (angles >= views.angles[0] - slack) & (angles <= views.angles[-1] + slack)
    near: NDArray[np.bool_] = inside & (gap <= widest)
    return near


def _places(views: TurnViews, angles: Floats, bins: Floats) -> tuple[Floats, Floats]:
    """Fractional views and bins of rays, (2, direction, bin), and their weights."""
    if views.turn:
        angles = views.first + np.mod(angles - views.first, 2 * np.pi)
    view = np.interp(angles, views.angles, np.arange(views.angles.size))
    place = np.stack([view, np.broadcast_to(bins, view.shape)])
    return place, np.ones(view.shape)
