"""The X-ray transform with the footprint of strips, without the frequencies beyond some limit.

The area that a pixel and a bin share is, along the detector, three boxes convolved: the bin and
the shadows of the pixel's two edges, a and b bins long. Its spectrum, sinc(f) sinc(a f) sinc(b f)
with f in cycles per bin, never ends; here it does. With bins that are continued periodically after
``period`` of them, a pixel u bins from a bin gives it, with f = l / period,

    dx dy / (pitch period) sum over |l| < samples of sinc(f) sinc(a f) sinc(b f) cos(2 pi f u).

Bins further than max(1, a, b) + 8 bins from the shadow of the image's circle get nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Grid, Parallel
from rift_cl.reference.matrix import MatrixProjector

_BESIDE = 8


def band_limited(
    grid: Grid, scan: Parallel, *, period: int, samples: int | Sequence[int]
) -> MatrixProjector:
    """The projector that is this matrix.

    Args:
        grid: the image; of a volume, every slice.
        scan: how it is looked at.
        period: bins after which a view repeats itself.
        samples: of the spectrum, ``1 / period`` cycles per bin apart, that are kept: of every view,
            or of each.
    """
    plane = grid.slice()
    kept = np.broadcast_to(samples, len(scan.angles))
    views = [
        _view(plane, scan, float(angle), period, int(count))
        for angle, count in zip(scan.angles, kept, strict=True)
    ]
    return MatrixProjector(np.concatenate(views), grid, scan)


def _view(
    grid: Grid, scan: Parallel, angle: float, period: int, samples: int
) -> NDArray[np.float64]:
    (dy, dx), pitch = grid.spacing, scan.pitch
    cosine, sine = math.cos(angle), math.sin(angle)
    y, x = grid.coordinates(0), grid.coordinates(1)
    t = (x * cosine + y[:, None] * sine).ravel() / pitch + scan.center
    frequencies = np.arange(1, samples) / period
    boxes = [1.0, abs(dx * cosine) / pitch, abs(dy * sine) / pitch]
    response = 2 * np.prod([np.sinc(width * frequencies) for width in boxes], axis=0)
    of_bins = np.exp(2j * np.pi * np.arange(scan.bins)[:, None] * frequencies)
    of_pixels = np.exp(-2j * np.pi * frequencies[:, None] * t)
    weights = 1 + ((of_bins * response) @ of_pixels).real
    seen = _seen(grid, scan, angle)
    return np.where(seen[:, None], weights, 0.0) * (dx * dy / (pitch * period))


def _seen(grid: Grid, scan: Parallel, angle: float) -> NDArray[np.bool_]:
    """The bins near the shadow of the circle about the image's middle sample."""
    (dy, dx), (ny, nx) = grid.spacing, grid.shape
    y, x = grid.coordinates(0)[ny // 2], grid.coordinates(1)[nx // 2]
    middle = (x * math.cos(angle) + y * math.sin(angle)) / scan.pitch + scan.center
    radius = math.hypot(nx // 2 * dx, ny // 2 * dy) / scan.pitch
    shadows = np.maximum(np.abs(dx * np.cos(scan.angles)), np.abs(dy * np.sin(scan.angles)))
    reach = radius + max(1.0, float(shadows.max()) / scan.pitch) + _BESIDE
    first = math.ceil(middle - reach)
    bins = np.arange(scan.bins)
    near: NDArray[np.bool_] = (bins >= first) & (bins <= first + math.floor(2 * reach))
    return near
