"""Line integrals that no object has: single samples far off, as dead pixels and lost packets leave.

A dense bead, a needle or a plate seen edge on stand as far out of their neighbours. But what is
measured of an object over the whole of a view is the same in all views of parallel rays, and in
those of fans it changes slowly; a sample that is wrong adds to its own view alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
# A sample stands out where both neighbours are so much nearer to the rest, in units of this
# percentile of the sizes of all.
_FAR, _STRONG = 1.0, 99.0
# Logarithms of few counts stand out as far, but most of those that do are less far: where more than
# so many times as many are beyond this share of it, they are noise.
_NEARLY, _TAIL = 0.5, 2.0
# Views on either side that tell what is measured of the object; the least jump of a view from them,
# in units of a sample that stands out; and the share of it that is left without these.
_BESIDE, _JUMP, _LEFT = 2, 0.75, 0.5
# Fewer views with such a jump may be parts that are cut off by the ends of the detector.
_FEWEST = 3


def stray_samples(lines: ArrayLike, angles: ArrayLike) -> NDArray[np.bool_]:
    """Samples that stand out of their row and of what all views measure together.

    Args:
        lines: (view, bin) line integrals of one row.
        angles: (view,) radians, in any order.

    Returns:
        (view, bin) which they are, in the order of ``lines``; none where that may be the object.
    """
    values = np.asarray(lines, np.float64)
    none = np.zeros(values.shape, bool)
    if values.shape[0] <= 2 * _BESIDE or values.shape[1] < 3:
        return none
    spikes = _spikes(values)
    limit = _FAR * np.percentile(np.abs(values), _STRONG)
    out = (np.abs(spikes) > limit) & (limit > 0)
    near = np.abs(spikes) > _NEARLY * limit
    if not out.any() or np.count_nonzero(near) > _TAIL * np.count_nonzero(out):
        return none
    order = np.argsort(np.mod(np.asarray(angles, np.float64), 2 * np.pi), kind="stable")
    whole = _jumps(values.sum(axis=1)[order])
    without = _jumps((values - spikes * out).sum(axis=1)[order])
    jump = whole > _JUMP * np.median(np.abs(spikes[out]))
    told = jump & (without < _LEFT * whole)
    return out if np.count_nonzero(told) >= _FEWEST else none


def _spikes(values: Floats) -> Floats:
    """How far samples exceed the greater of their neighbours, or fall short of the lesser one."""
    left, right = values[:, :-2], values[:, 2:]
    above = values[:, 1:-1] - np.maximum(left, right)
    below = values[:, 1:-1] - np.minimum(left, right)
    inner = np.maximum(above, 0) + np.minimum(below, 0)
    return np.pad(inner, ((0, 0), (1, 1)))


def _jumps(sums: Floats) -> Floats:
    """How far each view is from the median of those around it."""
    around = np.pad(sums, _BESIDE, mode="reflect")
    steps = [step for step in range(2 * _BESIDE + 1) if step != _BESIDE]
    beside = np.stack([around[step : step + len(sums)] for step in steps])
    jumps: Floats = np.abs(sums - np.median(beside, axis=0))
    return jumps
