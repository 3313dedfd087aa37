"""Regions of a photograph that are hard to reproduce for different reasons.

They are told by the photograph and its foreground alone, never by the picture that is scored, so
that two fits are scored on the same pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, ShapeError
from rift_cl.metrics.scores import finite_values

_Mask = NDArray[np.bool_]

REGIONS = ("silhouette", "highlights", "texture", "smooth", "background")

# Rec. 709.
_LUMA = (0.2126, 0.7152, 0.0722)
# Pixels on either side of the foreground's border that are its silhouette.
_REACH = 2
# How far a highlight is from the foreground's median luma to white, as a share.
_BRIGHT = 0.5
# Pixels along the square, and the luma's standard deviation in it, from which there is texture.
_SQUARE, _VARIED = 5, 0.02


def photograph_regions(
    photograph: ArrayLike, foreground: ArrayLike | None = None, counted: ArrayLike | None = None
) -> dict[str, _Mask]:
    """Where a photograph has a silhouette, highlights, texture, smooth surfaces and background.

    Each pixel that counts is in one region, the first of these that fits:

    - *silhouette*: a pixel of the other kind, foreground or background, that counts lies within 2
      pixels along rows and columns;
    - *background*: it is not foreground;
    - *highlights*: its luma (Rec. 709 of the display values) is at least halfway from the median
      of the foreground to white;
    - *texture*: the luma's standard deviation over the 5 x 5 pixels about it is above 0.02, that
      is 5 codes of 255; the photograph is reflected at its borders;
    - *smooth*: all else.

    One photograph does not tell gloss from white paint: both are highlights.

    Args:
        photograph: (height, width, 3) in display light, from 0 to 1.
        foreground: (height, width) booleans; all, and no silhouette, when not given.
        counted: (height, width) booleans, pixels that count at all; all when not given.

    Returns:
        (height, width) booleans by the names of ``REGIONS``, in their order; true nowhere where
        there is no such region.

    Raises:
        ShapeError: an array has another shape.
        DTypeError: the photograph is not real, or a mask not boolean.
        NonFiniteError: the photograph holds NaN or infinity.
    """
    from scipy.ndimage import uniform_filter

    colors = finite_values("photograph", photograph)
    if colors.shape[2:] != (3,) or not colors.size:
        raise ShapeError(f"photograph has shape {colors.shape}, wanted (height, width, 3)")
    shape = colors.shape[:2]
    front = _mask("foreground", foreground, shape)
    free = _mask("counted", counted, shape)
    luma = colors @ np.array(_LUMA)
    # Squares of differences from the mean, since those of values would cancel.
    varied = luma - luma.mean()
    mean = uniform_filter(varied, _SQUARE)
    variance = uniform_filter(varied**2, _SQUARE) - mean**2
    object_pixels = front & free
    middle = float(np.median(luma[object_pixels])) if object_pixels.any() else 1.0
    tests = {
        "silhouette": _border(front, free),
        "background": ~front,
        "highlights": luma >= middle + _BRIGHT * max(1 - middle, 0.0),
        "texture": variance > _VARIED**2,
        "smooth": np.ones(shape, np.bool_),
    }
    found = {}
    for name, test in tests.items():
        found[name] = free & test
        free = free & ~test
    return {name: found[name] for name in REGIONS}


def _border(front: _Mask, counted: _Mask) -> _Mask:
    """Pixels near which there are foreground and background that count."""
    from scipy.ndimage import maximum_filter

    kinds = (mask.astype(np.uint8) for mask in (front & counted, ~front & counted))
    near = [maximum_filter(kind, 2 * _REACH + 1) for kind in kinds]
    return np.asarray(near[0] & near[1], np.bool_)


def _mask(name: str, mask: ArrayLike | None, shape: tuple[int, ...]) -> _Mask:
    given = np.ones(shape, np.bool_) if mask is None else np.asarray(mask)
    if given.dtype != np.bool_:
        raise DTypeError(f"{name} has type {given.dtype}, wanted bool: compare it with a number")
    if given.shape != shape:
        raise ShapeError(f"{name} has shape {given.shape}, wanted the photograph's, {shape}")
    return given
