"""Whether views that are neighbours by their angles look like neighbours.

From one view to the next an object turns by a little, so that its projections change by a little.
Where angles were matched to views in another order, as by files sorted by name (1, 10, 100, 2 ..),
many neighbours have nothing in common, and views that the angles put far apart look alike instead.
Nothing of this hangs on the axis or the kind of beam.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.views import Views, binned, without_rings

Floats = NDArray[np.float64]

# Fewest views, most that are compared with each other, and bins that they are compared in, about.
_FEWEST, _MOST, _BINS = 90, 600, 128
# Bins over which slopes are taken.
_SLOPE = 2.0
# Steps between angles within which views are neighbours.
_NEAR = 3
# Mismatch from which on neighbours are none, as a share of that of most views, and beside that of
# the view that matches best among those further away.
_STRANGE, _TIMES = 0.5, 3.0
# Least share of such neighbours. Scans at hand had up to 0.006 with noise as strong as their
# signal, and at least 0.05 where their views were put in another order.
_SHARE = 0.03

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
    if len(views) < _FEWEST:
        return ""
    around = np.mod(angles, 2 * np.pi)
    order = np.argsort(around, kind="stable")
    around, slopes = around[order], _slopes(without_rings(views[order]))
    # Mismatch: 0 of views that are alike, 1 of such as have nothing in common.
    chosen = np.unique(np.linspace(0, len(slopes) - 2, min(len(slopes) - 1, _MOST)).astype(int))
    near = 1 - (slopes[chosen] * slopes[chosen + 1]).sum(axis=1)
    across = 1 - slopes[chosen] @ slopes[chosen].T
    apart = np.abs(around[chosen][:, None] - around[chosen][None])
    step = np.ptp(around) / (len(around) - 1)
    far = np.where(np.minimum(apart, 2 * np.pi - apart) > _NEAR * step, across, np.inf)
    strange = (near > _STRANGE * np.median(across)) & (near > _TIMES * far.min(axis=1))
    return WORDS if strange.mean() > _SHARE else ""


def _slopes(views: Views) -> Floats:
    """(angle, bin) slopes of length one; zero where a view has none."""
    from scipy.ndimage import gaussian_filter1d

    small = binned(views, max(1, round(views.shape[1] / _BINS))).astype(np.float64)
    slopes = gaussian_filter1d(small, _SLOPE, axis=1, order=1, mode="nearest")
    length = np.linalg.norm(slopes, axis=1, keepdims=True)
    return np.asarray(slopes / np.where(length > 0, length, 1))
