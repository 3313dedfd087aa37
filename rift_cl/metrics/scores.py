"""How close an image is to the truth: PSNR, SSIM and the fit that removes gain and offset.

Every score takes a mask, because a reconstruction is only defined inside the field of view and an
empty background would flatter it. Arrays of any real type are scored in double precision.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Grid

# Samples along each side of the window of SSIM, and so of the smallest image that it takes.
SSIM_WINDOW = 11
# Its standard deviation in samples, and its constants as shares of the range of values.
_SIGMA, _K1, _K2 = 1.5, 0.01, 0.03
_Reals = NDArray[np.float64]
_Mask = NDArray[np.bool_]


def psnr(
    image: ArrayLike, truth: ArrayLike, *, peak: float | None = None, mask: ArrayLike | None = None
) -> float:
    """Peak signal-to-noise ratio, ``10 log10(peak^2 / mean squared error)``.

    Args:
        image: what is scored, any shape.
        truth: what it should be, of the same shape.
        peak: the value that counts as full scale; 1 when not given, which whole numbers above 1,
            as in pictures of 8 bits, do not allow.
        mask: samples that count, boolean and of the same shape; all when not given.

    Returns:
        Decibels; infinity for a perfect image.

    Raises:
        ShapeError: the shapes differ or nothing is left to score.
        DTypeError: an array is not real, or the mask not boolean.
        NonFiniteError: ``image`` or ``truth`` holds NaN or infinity, masked or not.
        InputError: ``peak`` is not a positive number, or not given and an array has an integer
            type and values above 1.
    """
    found, wanted, counts = _checked(image, truth, mask)
    scale = _full_scale("psnr", peak, image, truth)
    error = float(np.mean((found - wanted)[counts] ** 2))
    return 10 * math.log10(scale**2 / error) if error > 0 else math.inf


def ssim(
    image: ArrayLike, truth: ArrayLike, *, peak: float | None = None, mask: ArrayLike | None = None
) -> float:
    """Structural similarity of Wang et al. (IEEE Trans. Image Process. 13, 2004).

    The window is Gaussian, 11 samples wide with sigma 1.5, the covariance is the population's.
    The map is averaged over every sample of the mask, the reflected border included; means that
    leave a border of 5 samples out differ a little. A window's moments are those of the samples of
    the mask in it, by their share of the window's weight, so that no other sample has a part in
    the score.

    Args:
        image: what is scored: (y, x), or (z, y, x) with a three-dimensional window.
        truth: what it should be, of the same shape.
        peak: the range of values that the data could have; 1 when not given, which whole numbers
            above 1, as in pictures of 8 bits, do not allow.
        mask: samples that count, boolean and of the same shape; all when not given.

    Returns:
        Similarity, 1 for a perfect image.

    Raises:
        ShapeError: the shapes differ, nothing is left to score, or a side is shorter than 11.
        DTypeError: an array is not real, or the mask not boolean.
        NonFiniteError: ``image`` or ``truth`` holds NaN or infinity, masked or not.
        InputError: ``peak`` is not a positive number, or not given and an array has an integer
            type and values above 1.
    """
    found, wanted, counts = _checked(image, truth, mask)
    scale = _full_scale("ssim", peak, image, truth)
    if found.ndim not in (2, 3) or min(found.shape) < SSIM_WINDOW:
        raise ShapeError(
            f"ssim: image has shape {found.shape}, wanted (y, x) or (z, y, x) with every side "
            f"{SSIM_WINDOW} or longer"
        )
    return float(np.mean(_similarity(found, wanted, counts, scale)[counts]))


def _similarity(x: _Reals, y: _Reals, counts: _Mask, scale: float) -> _Reals:
    """The map of SSIM, with moments of the samples that count; of no meaning at the others."""
    blurred = _window_of(counts)
    mean_x, mean_y, xx, yy, xy = map(blurred, (x, y, x * x, y * y, x * y))
    c1, c2 = (_K1 * scale) ** 2, (_K2 * scale) ** 2
    luminance = 2 * mean_x * mean_y + c1
    structure = 2 * (xy - mean_x * mean_y) + c2
    spread = (xx - mean_x * mean_x) + (yy - mean_y * mean_y) + c2
    return (luminance * structure) / ((mean_x**2 + mean_y**2 + c1) * spread)


def _window_of(counts: _Mask) -> Callable[[_Reals], _Reals]:
    """Means over SSIM's window about each sample, of the samples that count."""
    from scipy.ndimage import gaussian_filter

    def blurred(values: _Reals) -> _Reals:
        radius = SSIM_WINDOW // 2
        return np.asarray(gaussian_filter(values, _SIGMA, mode="reflect", radius=radius))

    if counts.all():
        return blurred
    # About a sample that does not count there may be none that does.
    share = np.where(counts, blurred(counts.astype(np.float64)), 1)
    return lambda values: blurred(np.where(counts, values, 0)) / share


def affine_fit(
    image: ArrayLike, truth: ArrayLike, *, mask: ArrayLike | None = None
) -> tuple[_Reals, float, float]:
    """The image with the gain and offset that bring it closest to the truth.

    For methods whose scale is arbitrary, such as unfiltered backprojection: minimises the sum of
    ``(gain * image + offset - truth)^2`` over the mask.

    Args:
        image: what is fitted, any shape.
        truth: what it should be, of the same shape.
        mask: samples that count, boolean and of the same shape; all when not given.

    Returns:
        ``gain * image + offset`` on the whole image, the gain, and the offset. A constant image
        has gain 0 and the mean of the truth for offset.

    Raises:
        ShapeError: the shapes differ or nothing is left to fit.
        DTypeError: an array is not real, or the mask not boolean.
        NonFiniteError: ``image`` or ``truth`` holds NaN or infinity, masked or not.
    """
    found, wanted, counts = _checked(image, truth, mask)
    x, y = found[counts], wanted[counts]
    if x.min() == x.max():
        gain = 0.0
    else:
        deviation = x - x.mean()
        gain = float(np.sum(deviation * (y - y.mean())) / np.sum(deviation**2))
    offset = float(y.mean() - gain * x.mean())
    return gain * found + offset, gain, offset


def disc(grid: Grid, *, radius: float | None = None) -> _Mask:
    """Mask of the samples in a disc about the grid's centre; a cylinder along z for a volume.

    Args:
        grid: the image or volume.
        radius: in the grid's unit of length; the inscribed disc, ``min(ny * dy, nx * dx) / 2``,
            when not given.

    Returns:
        Booleans of shape ``grid.shape``: true where the centre of the sample is in the disc.

    Raises:
        InputError: ``radius`` is not a positive number.
    """
    plane = grid.slice()
    if radius is None:
        radius = min(n * d for n, d in zip(plane.shape, plane.spacing, strict=True)) / 2
    if not (math.isfinite(radius) and radius > 0):
        raise InputError(f"disc: radius is {radius!r}, wanted a positive length")
    y, x = (plane.coordinates(axis) - plane.center[axis] for axis in (0, 1))
    inside = y[:, None] ** 2 + x**2 <= radius**2
    return np.broadcast_to(inside, grid.shape).copy()


def _checked(
    image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None
) -> tuple[_Reals, _Reals, _Mask]:
    found, wanted = finite_values("image", image), finite_values("truth", truth)
    if found.shape != wanted.shape:
        raise ShapeError(f"image has shape {found.shape} and truth {wanted.shape}; make them equal")
    counts = np.ones(found.shape, dtype=np.bool_) if mask is None else np.asarray(mask)
    if counts.dtype != np.bool_:
        raise DTypeError(f"mask has type {counts.dtype}, wanted bool: compare it with a number")
    if counts.shape != found.shape:
        raise ShapeError(f"mask has shape {counts.shape}, wanted that of the image, {found.shape}")
    if not counts.any():
        raise ShapeError("nothing to compare: the image is empty or the mask is false everywhere")
    return found, wanted, counts


def finite_values(name: str, array: ArrayLike) -> _Reals:
    """An array of real numbers in double precision.

    Raises:
        DTypeError: it is not real, or NumPy cannot read it.
        NonFiniteError: it holds NaN or infinity.
    """
    try:
        given: NDArray[Any] = np.asarray(array)
    except (TypeError, ValueError, RuntimeError) as error:
        # A tensor that requires a gradient, or is on another device, says itself what to do.
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise DTypeError(f"{name} cannot be read as an array of numbers: {reason}") from error
    if given.dtype.kind not in "biuf":
        raise DTypeError(f"{name} has type {given.dtype}, wanted real numbers")
    values = given.astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        index = tuple(int(i) for i in np.unravel_index(bad[0], values.shape))
        raise NonFiniteError(
            f"{name} holds {values[index]} at {index}, and {bad.size} such values in all; "
            "replace them before scoring"
        )
    return values


def _full_scale(function: str, peak: float | None, *arrays: ArrayLike) -> float:
    if peak is None:
        for array in map(np.asarray, arrays):
            if array.dtype.kind in "iu" and array.max() > 1:
                raise InputError(
                    f"{function}: values of type {array.dtype} reach {array.max()}; give the full "
                    f"scale, for example peak={np.iinfo(array.dtype).max}"
                )
        return 1.0
    if not (math.isfinite(peak) and peak > 0):
        raise InputError(f"{function}: peak is {peak!r}, wanted a positive number")
    return float(peak)
