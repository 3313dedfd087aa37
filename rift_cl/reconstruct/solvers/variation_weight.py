"""A weight of the total variation that follows the noise which the data show.

Noise of standard deviation s in the rays of n views pulls at a sample of side h with
``s h sqrt(n)``, and the slope of the variation there is the weight times h (h squared in a volume):
what noise alone draws is levelled by a weight that goes with ``s sqrt(n)`` (over h in a volume).
Where noise is a small share of the data it hides less, and less of that does best; the more bins,
the more, since noise of backprojections is strongest where it varies slowly. By trial
(``tools/compare_tv_weights.py``) both go with the root.

Noise is what mixed second differences of the data, along views and bins, leave: the views of an
object change slowly along at least one of these but at its edges, which a median does not see
(Immerkaer, Computer Vision and Image Understanding 64, 1996, for images).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.host_arrays import check_finite, download, is_device_array
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays, masked_data, mean_weight

Floats = NDArray[np.float32]

# The weight over ``s sqrt(n b s / m)``, of n views of b bins, m the greatest of the data.
_FACTOR = 0.43
# The least noise, as a share of the greatest data: what samples cannot show of an object.
_LEAST = 1e-3
# Rows of the detector that are looked at, evenly spaced.
_ROWS = 16
# The median of the sizes of normal numbers, and the gain of a second difference to white noise.
_MEDIAN, _GAIN = 0.6745, np.sqrt(6)


def variation_weight(A: LinearOperator, y: Any, *, weights: ArrayLike | None = None) -> float:
    """A weight for ``tv`` by the noise of the data; larger is smoother.

    Args:
        A: the projector of an image or a volume; views are compared in the order of their
            directions, those of a helix in that of its angles, and as they come where ``A.scan``
            has none.
        y: the data, of shape ``A.range``, (angle, ..., bin).
        weights: of the rays, as ``tv`` takes them, of any scale; 0 where nothing was measured.

    Returns:
        The weight, in the unit of y squared over the unit of TV (see ``tv``).

    Raises:
        NonFiniteError: y holds NaN or infinity where something was measured.
    """
    data = np.asarray(download(A.device, y) if is_device_array(y) else y)
    if weights is not None:
        # As the solver does, which gives the variation the data's weight.
        counted = np.broadcast_to(np.asarray(weights), data.shape)
        counted = counted / mean_weight(counted)
    else:
        counted = np.broadcast_to(A.weights if isinstance(A, WeightedRays) else 1, data.shape)
    data = masked_data(data, counted)
    check_finite(data, name="y")
    order = _views_in_order(A.scan, len(data))
    if data.ndim == 3:
        rows = np.unique(np.linspace(0, data.shape[1] - 1, _ROWS).astype(int))
        data, counted = data[:, rows], counted[:, rows]
    data, roots = data[order].astype(np.float32), np.sqrt(counted[order], dtype=np.float32)
    largest = float(np.abs(data * roots).max(initial=0))
    noise = max(noise_of_rays(data, roots), _LEAST * largest)
    if noise == 0:
        return 0.0
    # Weights multiply what noise pulls at by their roots once more.
    rays = len(data) * data.shape[-1] * float(np.mean(roots**2))
    weight = _FACTOR * noise * np.sqrt(rays * noise / largest)
    if len(A.domain) == 3 and A.grid is not None:
        weight /= np.prod(A.grid.spacing) ** (1 / 3)
    return float(weight)


def _views_in_order(scan: Any, count: int) -> NDArray[np.intp]:
    """The numbers of views, each beside those that look most alike."""
    angles = getattr(scan, "angles", None)
    if angles is None:
        return np.arange(count)
    # Angles of many turns, such as multiples of the golden one, come by the same places again.
    if getattr(scan, "circular", True):
        angles = np.mod(angles - angles.min(), 2 * np.pi)
    return np.argsort(angles, kind="stable")


def noise_of_rays(data: Floats, roots: Floats) -> float:
    """The standard deviation of the noise of a ray of weight 1; 0 where there is none to compare.

    Args:
        data: (angle, bin) or (angle, row, bin), views in order.
        roots: of the weights of the rays, of the same shape; 0 where nothing was measured.
    """
    bends, known, gain = data, roots > 0, 1.0
    for axis in (0, data.ndim - 1):
        if data.shape[axis] < 3:
            continue
        bends, gain = np.diff(bends, 2, axis=axis), gain * _GAIN
        before, at, after = (_cut(known, axis, first) for first in range(3))
        known, roots = before & at & after, _cut(roots, axis, 1)
    found = np.abs(bends * roots)[known]
    return float(np.median(found)) / _MEDIAN / gain if found.size and gain > 1 else 0.0


def _cut(values: NDArray[Any], axis: int, first: int) -> NDArray[Any]:
    """All but two along an axis, from the first one on."""
    count = values.shape[axis] - 2
    return values[(slice(None),) * axis + (slice(first, first + count),)]
