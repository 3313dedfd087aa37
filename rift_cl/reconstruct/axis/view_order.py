"""Whether views that are neighbours by their angles look like neighbours, all or but for one pair.

From one view to the next an object turns by a little, so that its projections change by a little.
Where angles were matched to views in another order, as by files sorted by name (1, 10, 100, 2 ..),
many neighbours have nothing in common, and views that the angles put far apart look alike instead.
Where views are missing, where the object moved, and where a second pass begins, it is one pair
alone. Nothing of this hangs on the axis or the kind of beam.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.views import Views, binned, without_rings

Floats = NDArray[np.float64]

# Fewest views and bins, most views that are compared with each other, and in how many bins, about.
_FEWEST, _FEWEST_BINS, _MOST, _BINS = 90, 96, 600, 128
# Bins over which slopes are taken, and of the blocks that make two halves.
_SLOPE, _BLOCK = 2.0, 12
# Steps between angles within which views are neighbours.
_NEAR = 3
# Mismatch from which on neighbours are none, as a share of that of most views, and beside that of
# the view that matches best among those further away.
_STRANGE, _TIMES = 0.5, 3.0
# Least share of such neighbours, and by how much others must match better in the other half of the
# bins: as a share of the mismatch of most views, and in standard errors of the mean.
_SHARE, _BETTER, _SURE = 0.07, 0.5, 7.0
# Least mismatch of a pair that stands out, as a share of that of most views, and beside the next.
_JUMP, _ALONE = 0.1, 8.0
# By how much its angles may be further apart than those of most neighbours.
_STEP = 1.5

WORDS = (
    "views that are neighbours by their angles do not look alike, while others do: the angles are "
    "probably in another order than the views, as where files were sorted by name"
)


def order_doubt(views: Views, angles: Floats) -> str:
    """What the views of a row have against the order of their angles; empty where nothing.

    Args:
        views: line integrals of one row, (angle, bin), of any beam.
        angles: their directions in radians.

    Returns:
        The end of a sentence.
    """
    if len(views) < _FEWEST or views.shape[1] < _FEWEST_BINS:
        return ""
    around = np.mod(angles, 2 * np.pi)
    order = np.argsort(around, kind="stable")
    around, halves = around[order], _halves(without_rings(views[order]))
    count = len(around) - 1
    chosen = np.unique(np.linspace(0, count - 1, min(count, _MOST)).astype(int))
    apart = np.abs(around[chosen][:, None] - around[chosen][None])
    away = np.minimum(apart, 2 * np.pi - apart) > _NEAR * np.ptp(around) / count
    # What matches best among many matches by chance as well: it is looked for in one half of the
    # bins and judged in the other, whose noise is another.
    near, others = _from_next(halves[0])[chosen], _from_others(halves[0][chosen])
    most, others = np.median(others), np.where(away, others, np.inf)
    best = others.argmin(axis=1)
    strange = (near > _STRANGE * most) & (near > _TIMES * others.min(axis=1))
    if strange.mean() <= _SHARE:
        return ""
    near, others = _from_next(halves[1])[chosen], _from_others(halves[1][chosen])
    better = (near - others[np.arange(len(chosen)), best])[strange]
    chance = _SURE * better.std() / np.sqrt(len(better))
    return WORDS if better.mean() > max(_BETTER * np.median(others), chance) else ""


def jump_doubt(views: Views, angles: Floats) -> str:
    """Two views that follow each other by their angles and do not look so; empty where none.

    Args:
        views: as for ``order_doubt``.
        angles: their directions in radians.

    Returns:
        The end of a sentence.
    """
    if len(views) < _FEWEST or views.shape[1] < _FEWEST_BINS:
        return ""
    order = np.argsort(angles, kind="stable")
    steps = np.diff(angles[order])
    halves = _halves(without_rings(views[order]))
    near = np.array([_from_next(half) for half in halves])
    at = int(near[0].argmax())
    rest = np.delete(near, at, axis=1)
    # A single view that went wrong makes two such pairs.
    alone = (near[:, at] > _ALONE * rest.max(axis=1)).all()
    some = np.linspace(0, len(steps), min(len(steps), _MOST)).astype(int)
    most = np.array([np.median(_from_others(half[some])) for half in halves])
    if not alone or steps[at] > _STEP * np.median(steps) or (near[:, at] < _JUMP * most).any():
        return ""
    first, second = sorted((int(order[at]), int(order[at + 1])))
    return (
        f"views {first} and {second}, whose angles are neighbours, differ more than "
        f"{_ALONE:.0f} times as much as all others: views are missing between them, the object "
        "moved there, or a second pass began"
    )


def _halves(views: Views) -> tuple[Floats, Floats]:
    """(angle, bin) slopes of the even and of the odd blocks of bins, each of length one or zero.

    Blocks are wider than the noise of a detector reaches, whose light spreads over some bins.
    """
    from scipy.ndimage import gaussian_filter1d

    small = binned(views, max(1, round(views.shape[1] / _BINS))).astype(np.float64)
    slopes = gaussian_filter1d(small, _SLOPE, axis=1, order=1, mode="nearest")
    odd = np.arange(slopes.shape[1]) // _BLOCK % 2 == 1
    return _normalised(slopes[:, ~odd]), _normalised(slopes[:, odd])


def _normalised(slopes: Floats) -> Floats:
    length = np.linalg.norm(slopes, axis=1, keepdims=True)
    return np.asarray(slopes / np.where(length > 0, length, 1))


def _from_next(slopes: Floats) -> Floats:
    """Mismatch of each view and the next one: 0 where they are alike, 1 with nothing in common."""
    return np.asarray(1 - (slopes[:-1] * slopes[1:]).sum(axis=1))


def _from_others(slopes: Floats) -> Floats:
    """The same of all views with each other."""
    return np.asarray(1 - slopes @ slopes.T)
