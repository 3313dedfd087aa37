"""scikit-image's ``radon`` and ``iradon`` on any OpenCL device, with its signatures.

    from rift_cl.interop.skimage import iradon, radon

Angles are in degrees and a sinogram is (detector, angle). The rotation axis stands in the pixel
``n // 2`` of either axis and is seen at the bin ``n // 2``; y points down, and a growing angle
turns the image clockwise on the screen. Shapes, types, filters, scale and warnings are
those of scikit-image 0.26. What differs:

- Lines are integrated whole. scikit-image turns a square and sums its rows, so that it leaves out
  what a corner of the square sticks out of it; of an image that is zero outside the circle, both
  see the same.
- ``radon`` collects the areas that pixels share with bins (the footprint ``strip``), and not the
  rows of a turned image: sinograms differ by a few tenths of a per cent. Of our footprints it is
  the nearest to scikit-image.
- ``iradon`` reads views between bins, as scikit-image's does (the footprint ``linear``). So the two
  are no adjoint pair, there as here; ``rift_cl.Projector`` and its transpose are.
- The numbers are float32 within. The result has the type that scikit-image would give.
- NaN and infinity are refused.

``RIFT_DEVICE`` chooses the device.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skimage.util import img_as_float

from rift_cl.cl.discovery import default_device
from rift_cl.cl.host_arrays import as_real_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Grid, Parallel
from rift_cl.geometry.numbers import real_numbers
from rift_cl.interop.spline_backprojection import backproject_spline
from rift_cl.operators.filters.ramp_filters import Ramp, ViewFilter
from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector

__all__ = ["iradon", "radon"]

# scikit-image's names of filters, and ours.
_WINDOWS = {
    "ramp": "ram-lak",
    "shepp-logan": "shepp-logan",
    "cosine": "cosine",
    "hamming": "hamming",
    "hann": "hann",
}
# Degree of the spline that goes through the bins.
_DEGREES = {"linear": 1, "nearest": 0, "cubic": 3}


def radon(
    image: ArrayLike,
    theta: ArrayLike | None = None,
    circle: bool = True,
    *,
    preserve_range: bool = False,
) -> NDArray[Any]:
    """Project an image, as ``skimage.transform.radon`` does.

    Args:
        image: (ny, nx) image.
        theta: (angles,) directions in degrees; 0, 1, .. 179 if not given.
        circle: take the image for zero outside the circle in its middle, so that a view has
            ``min(ny, nx)`` bins; otherwise it has as many as the diagonal of the larger square.
        preserve_range: keep the values of whole numbers; otherwise they are brought to 0..1 as
            ``skimage.util.img_as_float`` does.

    Returns:
        (bins, angles) sinogram, float32 of a float16 or float32 image and else float64.

    Raises:
        ShapeError: the image is not of two dimensions, or there is no angle.
        InputError: a value or an angle is not a finite real number.

    Warns:
        UserWarning: ``circle`` is set and the image is not zero outside the circle.
    """
    values = _as_float("image", image, preserve_range)
    if circle:
        values = _square(values)
        bins = values.shape[0]
    else:
        bins = math.ceil(math.sqrt(2) * max(values.shape))
    theta = np.arange(180) if theta is None else theta
    A = _projector(values.shape, theta, bins, "strip")
    return np.ascontiguousarray(A(values, name="image").T, values.dtype)


def iradon(
    radon_image: ArrayLike,
    theta: ArrayLike | None = None,
    output_size: int | None = None,
    filter_name: str | None = "ramp",
    interpolation: str = "linear",
    circle: bool = True,
    preserve_range: bool = True,
) -> NDArray[Any]:
    """Reconstruct by filtered backprojection, as ``skimage.transform.iradon`` does.

    Every view weighs pi / angles, whatever the angles are; ``rift_cl.fbp`` weighs them by the
    share of the half-circle that they stand for.

    Args:
        radon_image: (bins, angles) sinogram.
        theta: (angles,) directions in degrees; evenly over 0 .. 180 if not given.
        output_size: rows and columns of the result; if not given, ``bins`` with ``circle`` and
            ``floor(bins / sqrt(2))`` without.
        filter_name: ``ramp``, ``shepp-logan``, ``cosine``, ``hamming``, ``hann``, or None for no
            filter.
        interpolation: between bins: ``linear``, which is the fastest, ``nearest`` or ``cubic``.
        circle: the result is zero outside the circle in its middle.
        preserve_range: as in ``radon``.

    Returns:
        (output_size, output_size) image, float32 of a float16 or float32 sinogram and else
        float64.

    Raises:
        ShapeError: the sinogram is not of two dimensions, or there are not as many angles as it
            has columns.
        InputError: a name is unknown, a size is none, or a value is not a finite real number.
    """
    values = _as_float("radon_image", radon_image, preserve_range)
    dtype, (bins, views) = values.dtype, values.shape
    theta = np.linspace(0, 180, views, endpoint=False) if theta is None else theta
    _check_name("interpolation", interpolation, _DEGREES)
    if filter_name is not None:
        _check_name("filter_name", filter_name, _WINDOWS)
    size = (
        (bins if circle else math.isqrt(bins * bins // 2)) if output_size is None else output_size
    )
    if circle:
        values = _with_corners(values)
    A = _projector((size, size), theta, len(values), "linear")
    if len(A.scan.angles) != views:
        raise ShapeError(
            f"theta has {len(A.scan.angles)} angles and radon_image {views} columns: give one "
            "angle for each column"
        )
    sinogram = np.ascontiguousarray(values.T)
    if filter_name is not None:
        ramp = Ramp(_WINDOWS[filter_name])
        sinogram = ViewFilter(A.scan, ramp, device=A.device)(sinogram, name="radon_image")
    degree = _DEGREES[interpolation]
    image = A.T(sinogram) if degree == 1 else backproject_spline(A, sinogram, degree)
    # The ramp passes 1/2 at the Nyquist frequency where scikit-image's passes 1.
    image *= np.pi / views if filter_name is not None else np.pi / (2 * views)
    if circle:
        image[_outside_circle(image.shape)] = 0
    result: NDArray[Any] = image.astype(dtype)
    return result


def _as_float(name: str, values: Any, preserve_range: bool) -> NDArray[Any]:
    """The numbers as scikit-image takes them: float32, or float64 where they are not single."""
    array = as_real_array(values, name=name)
    if array.ndim != 2 or 0 in array.shape:
        raise ShapeError(f"{name} has shape {array.shape}, wanted two dimensions and no zero")
    if array.dtype.kind == "f":
        return array.astype(np.float32 if array.dtype.itemsize <= 4 else np.float64, copy=False)
    numbers: NDArray[Any] = array.astype(np.float64) if preserve_range else img_as_float(array)
    return numbers


def _projector(
    shape: tuple[int, ...], theta: ArrayLike, bins: int, footprint: str
) -> ParallelProjector:
    """A projector whose axis is in the pixel n // 2 and in the bin n // 2.

    In scikit-image a point (x, y) is seen at ``t = x cos(theta) - y sin(theta)``: its angle is
    ours with the other sign.
    """
    degrees = real_numbers(theta)
    if degrees is None:
        raise InputError(f"theta is {theta!r}, wanted angles in degrees")
    middle = [(n - 1) / 2 - n // 2 for n in shape]
    scan = Parallel(-np.deg2rad(degrees), bins, center=bins // 2)
    return PhaseProjector(Grid(shape, center=middle), scan, footprint, device=default_device())


def _square(image: NDArray[Any]) -> NDArray[Any]:
    """The square in the middle of an image, which must be zero outside the square's circle."""
    if image[_outside_circle(image.shape)].any():
        warnings.warn(
            "radon: the image is not zero outside the reconstruction circle, and what is there is "
            "lost or smeared: pass circle=False",
            stacklevel=3,
        )
    side = min(image.shape)
    # An odd excess is cut as scikit-image cuts it.
    ny, nx = (-(-(n - side) // 2) for n in image.shape)
    return image[ny : ny + side, nx : nx + side]


def _outside_circle(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    y, x = np.ogrid[: shape[0], : shape[1]]
    outside: NDArray[np.bool_] = (y - shape[0] // 2) ** 2 + (x - shape[1] // 2) ** 2 > (
        min(shape) // 2
    ) ** 2
    return outside


def _with_corners(sinogram: NDArray[Any]) -> NDArray[Any]:
    """A sinogram of the circle as one of the square about it: zeros on either side."""
    bins = sinogram.shape[0]
    wide = math.ceil(math.sqrt(2) * bins)
    before = wide // 2 - bins // 2
    return np.pad(sinogram, ((before, wide - bins - before), (0, 0)))


def _check_name(argument: str, name: Any, known: dict[str, Any]) -> None:
    if name not in known:
        raise InputError(f"{argument} is {name!r}, wanted one of {', '.join(known)}")
