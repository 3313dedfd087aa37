"""FLIP: the difference that a person sees who flips between two pictures.

The computation is NVIDIA's own (package ``flip-evaluator``, BSD-3-Clause), so that figures agree
with those that others print.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.metrics.scores import finite_values

# 0.7 m before a monitor of 3840 pixels and 0.7 m across, as the paper has it.
PIXELS_PER_DEGREE = 67.0
# Degrees that the widest of the map's filters reaches: three standard deviations of the blue-yellow
# contrast sensitivity, the Gaussian of the paper's table 1 with b = 0.04.
_REACH = 3 * math.sqrt(0.04 / (2 * math.pi**2))


def flip(
    image: ArrayLike,
    truth: ArrayLike,
    *,
    pixels_per_degree: float = PIXELS_PER_DEGREE,
    mask: ArrayLike | None = None,
) -> float:
    """Mean of the FLIP error map (Andersson et al., Proc. ACM CGIT 3(2), 2020).

    Args:
        image: what is scored, (height, width, 3) in display light (sRGB) from 0 to 1; values
            beyond are clipped.
        truth: what it should be, of the same shape.
        pixels_per_degree: of the observer's field of view; a larger number is a person who is
            further away and sees less.
        mask: (height, width) booleans, the pixels that count; all when not given. The map is
            averaged over those whose filters see no other, see ``flip_pixels``.

    Returns:
        From 0, for equal pictures, to 1; about 0.97 for black in place of white.

    Raises:
        ShapeError: the shapes differ, an array is no colour picture, or the map has no pixel that
            is of those of the mask alone.
        DTypeError: an array is not real, or the mask not boolean.
        NonFiniteError: an array holds NaN or infinity.
        InputError: ``pixels_per_degree`` is not a positive number, or the package
            ``flip-evaluator`` is not installed.
    """
    found, wanted = finite_values("image", image), finite_values("truth", truth)
    if found.shape != wanted.shape or found.shape[2:] != (3,) or not found.size:
        raise ShapeError(
            f"flip: image has shape {found.shape} and truth {wanted.shape}, wanted (height, width, "
            "3) twice"
        )
    if not (math.isfinite(pixels_per_degree) and pixels_per_degree > 0):
        raise InputError(
            f"flip: pixels_per_degree is {pixels_per_degree!r}, wanted a positive number"
        )
    counts = None if mask is None else _map_mask(mask, found.shape[:2], pixels_per_degree)
    evaluate = flip_evaluator().evaluate
    pair = [np.ascontiguousarray(np.clip(a, 0, 1), np.float32) for a in (wanted, found)]
    errors, mean, _ = evaluate(
        *pair, "LDR", applyMagma=False, parameters={"ppd": pixels_per_degree}
    )
    if counts is None:
        return float(mean)
    return float(np.mean(np.asarray(errors, np.float64).reshape(counts.shape)[counts]))


def flip_pixels(
    mask: NDArray[np.bool_], *, pixels_per_degree: float = PIXELS_PER_DEGREE
) -> NDArray[np.bool_]:
    """The pixels of FLIP's map that no pixel outside of a mask has a part in.

    Args:
        mask: (height, width) the pixels that count.
        pixels_per_degree: as ``flip`` has it, 67 for filters that reach 10 pixels.
    """
    from scipy.ndimage import minimum_filter

    reach = math.ceil(_REACH * pixels_per_degree)
    # What lies beyond the picture is the pixel at its edge.
    return np.asarray(minimum_filter(mask, size=2 * reach + 1, mode="nearest"))


def _map_mask(
    mask: ArrayLike, shape: tuple[int, ...], pixels_per_degree: float
) -> NDArray[np.bool_]:
    counts = np.asarray(mask)
    if counts.dtype != np.bool_:
        raise DTypeError(f"mask has type {counts.dtype}, wanted bool: compare it with a number")
    if counts.shape != shape:
        raise ShapeError(f"flip: mask has shape {counts.shape}, wanted (height, width), {shape}")
    if not counts.any():
        raise ShapeError("flip: nothing to compare, the mask is false everywhere")
    seen = flip_pixels(counts, pixels_per_degree=pixels_per_degree)
    if not seen.any():
        raise ShapeError(
            "flip: nothing to compare, the filters see pixels that the mask leaves out everywhere"
        )
    return seen


def flip_evaluator() -> Any:
    """The package that computes FLIP.

    Raises:
        InputError: it is not installed.
    """
    try:
        import flip_evaluator
    except ImportError as error:
        raise InputError(
            "FLIP is computed by flip-evaluator, which is not installed: pip install flip-evaluator"
        ) from error
    return flip_evaluator
