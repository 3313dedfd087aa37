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

from typing import NamedTuple

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
# Least share of its rays that a parallel view holds.
_HELD = 0.25
# Rays beyond the ends of the scan, or of a row, by this share of a step still count.
_SLACK = 1e-6


class ParallelViews(NamedTuple):
    """A fan's rays as parallel views.

    Args:
        views: (direction, row, bin).
        directions: in radians.
        bins: the fan's bin that each of their own bins comes from, increasing, as far apart as the
            fan's at the centre.
        seen: (direction, 2) the first and the last of their own bins that rays were taken for;
            what views hold beyond means nothing.
    """

    views: Views
    directions: Floats
    bins: Floats
    seen: Floats

    def whole(self) -> ParallelViews:
        """Those that hold all rays."""
        kept = np.ptp(self.seen, axis=1) == self.bins.size - 1
        return self._replace(
            views=self.views[kept], directions=self.directions[kept], seen=self.seen[kept]
        )


def parallel_views(rows: Views, fan: Fan) -> ParallelViews:
    """Parallel views of the rays as they were taken.

    Args:
        rows: line integrals, (view, row, bin), of rows that are fans.
        fan: their geometry as far as it is known.

    Returns:
        The views that are covered as a whole, one at least, and those that are in part: a scan
        of half a turn and the fan's angle holds all of some rays' opposites, but no whole view's.

    Raises:
        InputError: no parallel view is covered: the span is too short, or views are too far apart.
    """
    turned, group = in_one_turn(fan.angles)
    views = turn_views(turned)
    gamma, reach = fan.fan_angles(), fan.source_to_axis
    step = fan.pitch / fan.magnification
    low, high = (reach * np.sin(gamma[[0, -1]]) / step).tolist()
    t = np.arange(np.ceil(low - _SLACK), np.floor(high + _SLACK) + 1) * step
    leaves = np.arcsin(t / reach)
    # Views in steps of which half a turn is a whole number have others exactly opposite.
    apart = np.pi / max(1, round(np.pi / views.step))
    if views.turn:
        theta = views.first + np.arange(round(2 * np.pi / apart)) * apart
    else:
        first, last = views.first - float(leaves.max()), views.last - float(leaves.min())
        # One of them begins where whole views do.
        begin = views.first - float(leaves.min())
        begin -= (begin - first) // apart * apart
        theta = np.arange(begin, last + _SLACK, apart)
    ray = np.asarray(theta[:, None] + leaves, np.float64)
    covered = _between(views, ray, _GAP)
    if not covered.all(axis=1).any():
        if _between(views, ray, np.inf).all(axis=1).any():
            raise InputError(
                f"views are up to {np.rad2deg(np.diff(views.angles).max()):.3g} degrees apart, and "
                "parallel views are read between views that are at most "
                f"{np.rad2deg(_GAP):.3g} degrees apart"
            )
        raise InputError(
            f"the views span {np.rad2deg(views.last - views.first):.3g} degrees, the fan "
            f"{np.rad2deg(np.ptp(gamma)):.3g}: there is no direction of which every ray was taken"
        )
    held = covered.sum(axis=1)
    ends = covered.argmax(axis=1), t.size - 1 - covered[:, ::-1].argmax(axis=1)
    kept = (held >= _HELD * t.size) & (held == ends[1] - ends[0] + 1)
    stack = means(rows, group)[views.order]
    bins = bins_of(fan, leaves)
    places = _places(views, ray[kept], bins)
    parallel = [resampled(stack[:, row], [places], 3) for row in range(stack.shape[1])]
    seen = np.stack(ends, axis=1)[kept].astype(np.float64)
    return ParallelViews(np.stack(parallel, axis=1), theta[kept], bins, seen)


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
