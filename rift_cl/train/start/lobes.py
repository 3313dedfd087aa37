"""Where the lobes of splats point at first: along what they are seen from, or across their disc.

A direction d goes from a camera to a splat, so that a lobe with the axis d is seen at its brightest
by that camera. What stands between a camera and a splat is not asked for: cameras on the far side
of the scene's middle are taken not to see it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera
from rift_cl.splat.sight import ways_to
from rift_cl.train.per_view.quaternions import rotated
from rift_cl.train.start.points import focus_of

# A splat is a disc if its shortest axis is below this share of the next one.
_DISC = 0.5

Floats = NDArray[np.float64]


def lobe_axes(raw: Mapping[str, NDArray[np.float32]], cameras: Sequence[Camera]) -> Floats:
    """Directions (N, 3), of length one, from the cameras' side to the far side of each splat.

    Args:
        raw: the splats' ``means``, ``quats`` and ``log_scales``.
        cameras: that look at them.
    """
    means, quats = raw["means"].astype(float), raw["quats"].astype(float)
    seen = _mean_views(means, cameras)
    sizes = raw["log_scales"].astype(float)
    shortest = sizes.argmin(axis=1)
    flat = np.sort(sizes, axis=1)
    disc = (flat[:, 0] < flat[:, 1] + np.log(_DISC)) & quats.any(axis=1)
    axes = seen.copy()
    axes[disc] = rotated(quats[disc], np.eye(3)[shortest[disc]])
    # The side of a disc that cameras look at.
    return np.where((axes * seen).sum(axis=1, keepdims=True) < 0, -axes, axes)


def _mean_views(means: Floats, cameras: Sequence[Camera]) -> Floats:
    """The mean direction of the cameras on a splat's side of the scene."""
    outward = means - focus_of(cameras)
    total, everywhere = np.zeros(means.shape), np.zeros(means.shape)
    for camera in cameras:
        ways = _unit(ways_to(camera, means))
        before = np.maximum(-(ways * _unit(outward)).sum(axis=1, keepdims=True), 0)
        total += before * ways
        everywhere += ways
    return _unit(np.where((total == 0).all(axis=1, keepdims=True), everywhere, total))


def _unit(vectors: Floats) -> Floats:
    """Vectors of length one; along z where there is no length."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0, vectors / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
