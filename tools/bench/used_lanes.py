"""How many pixels a picture's splats count in: the work that no rasterizer can leave out."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from rift_cl import Device

# Splats of a tile that are looked at together.
_TOGETHER = 512


def used_lanes(device: Device, frame: Any) -> int:
    """Pairs of a pixel and a splat that counted there, before the pixel was finished.

    Counted from the frame's lists as the definition says (alpha >= 1/255, no more once less than
    1e-4 of the light would pass), whatever the kernels evaluate besides.

    Args:
        device: where the frame is.
        frame: what ``Renderer.forward`` returned, not in bands.
    """
    lists, (height, width) = frame.lists, frame.camera.size
    edge = frame.raster_pass.settings.tile
    starts, splats = device.get(lists.starts), device.get(lists.entries)[:, 0]
    screen = device.get(frame.projection.screen)
    used = 0
    for tile, (first, past) in enumerate(itertools.pairwise(starts)):
        y0, x0 = tile // lists.tiles.across * edge, tile % lists.tiles.across * edge
        rows, columns = min(edge, height - y0), min(edge, width - x0)
        left = np.ones((rows, columns))
        for begin in range(first, past, _TOGETHER):
            listed = screen[splats[begin : min(begin + _TOGETHER, past)]]
            alive, left = _counted(listed, left, (y0, x0))
            used += alive
            if not (left > 0).any():
                break
    return used


def _counted(screen: Any, left: Any, corner: tuple[int, int]) -> tuple[int, Any]:
    """Pairs that counted, and what is left of the light; 0 where a pixel is finished."""
    y, x = (np.arange(n) + first + 0.5 for n, first in zip(left.shape, corner, strict=True))
    mean_x, mean_y, a, b, c, weight = (column[:, None, None] for column in screen[:, :6].T)
    dx, dy = mean_x - x, mean_y - y[:, None]
    sigma = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
    alpha = np.minimum(weight * np.exp(-np.maximum(sigma, 0)), 0.99)
    alpha = np.where(alpha >= 1 / 255, alpha, 0)
    passed = left * np.cumprod(1 - alpha, axis=0)
    goes_on = passed > 1e-4
    counted = (alpha > 0) & goes_on
    finished = ~goes_on[-1]
    return int(counted.sum()), np.where(finished, 0.0, passed[-1])
