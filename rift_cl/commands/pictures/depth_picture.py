"""Depth as a picture: near is bright, far is dark, nothing is black.

Colours follow the logarithm of depth, so that a scene that goes on to the horizon leaves near
things colours of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.pictures.small_looks import small_looks
from rift_cl.geometry import Camera
from rift_cl.splat.renderer import DepthKind, Renderer
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float32]

_COLORS = "viridis"
# Share of the pixels that lie before or behind the window.
_BEYOND = 0.02
# Alpha above which a pixel's depth counts for the window.
_SOLID = 0.5
# Alpha below which a pixel shows nothing whose depth could be told.
LEAST_ALPHA = 1 / 255


def depth_and_alpha(
    renderer: Renderer, splats: Splats, camera: Camera, kind: DepthKind = "expected"
) -> tuple[Floats, Floats]:
    """Depth and alpha, (height, width) each."""
    image, seen = renderer.picture(splats, camera, depth=kind)
    return image[..., -1], np.clip(1 - seen, 0, 1)


def depth_window(
    renderer: Renderer, splats: Splats, cameras: Sequence[Camera]
) -> tuple[float, float]:
    """Depths between which most of what cameras see lies, near before far.

    Each of a few cameras has a window of its own, and the medians are taken, so that one that
    stands in a fog of wide splats does not take the colours from the others.
    """
    windows = []
    for camera in small_looks(cameras):
        depth, alpha = depth_and_alpha(renderer, splats, camera)
        if (alpha > _SOLID).any():
            windows.append(window_of(depth, alpha))
    if not windows:
        return 1.0, 2.0
    near, far = np.median(windows, axis=0).tolist()
    return near, far


def window_of(depth: Floats, alpha: Floats) -> tuple[float, float]:
    """Depths between which most of what is seen lies; near before far, both positive."""
    solid = depth[(alpha > _SOLID) & (depth > 0)]
    if solid.size == 0:
        return 1.0, 2.0
    near, far = (float(v) for v in np.quantile(solid, [_BEYOND, 1 - _BEYOND]))
    return (near, far) if far > 1.001 * near else (0.9 * near, 1.1 * near)


def depth_picture(depth: Floats, alpha: Floats, window: tuple[float, float]) -> Floats:
    """Colours of (height, width) depths in display light, (height, width, 3), dark as alpha is."""
    near, far = window
    held = np.clip(np.nan_to_num(depth, nan=far), near, far)
    place = np.log(far / held) / np.log(far / near)
    return np.asarray(_table()[np.rint(place * 255).astype(int)] * alpha[..., None], np.float32)


@cache
def _table() -> Floats:
    from matplotlib import colormaps

    return np.asarray(colormaps[_COLORS](np.arange(256))[:, :3], np.float32)
