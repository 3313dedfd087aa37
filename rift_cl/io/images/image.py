"""Pictures: PNG out, and PNG, OpenEXR, TIFF, JPEG, HDR or HEIC in."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.images.read_picture import read_pixels
from rift_cl.io.output import atomic_path

_CHANNELS = (1, 3, 4)


def write_png(path: str | os.PathLike[str], image: ArrayLike) -> None:
    """Write an image in display light (sRGB codes) as an 8-bit PNG.

    Args:
        path: the file, ``.png``.
        image: (y, x), or (y, x, channel) with 1, 3 or 4 channels; real numbers in [0, 1], which
            are clipped to that range and rounded, or uint8 codes. Alpha is not multiplied in.

    Raises:
        InputError: the name does not end in ``.png``.
        ShapeError: the image has other axes, or an empty one.
        DTypeError: it holds neither real numbers nor uint8.
        NonFiniteError: it holds NaN or infinity.
        OutputError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: a PNG is to be written, let the name end in .png")
    pixels = _codes(np.asarray(image))
    attributes = {"oiio:ColorSpace": "sRGB", "oiio:UnassociatedAlpha": 1}
    with atomic_path(path) as part:
        write_pixels(part, pixels, format="png", attributes=attributes)


def read_image(path: str | os.PathLike[str], *, budget: int | None = None) -> NDArray[np.float32]:
    """Read an image as it is stored: (y, x) where there is one channel, else (y, x, channel).

    Integer codes are scaled to [0, 1] and stay in the light that they are stored in, display light
    by custom; the numbers of OpenEXR, HDR and floating TIFF are returned as they are, which is
    linear light by custom. Colour profiles are not applied. Alpha is straight:
    where a file holds colours with alpha multiplied in, as OpenEXR does, they are divided by it.
    Rows and columns are those of the file, whatever EXIF says about its orientation.

    Args:
        path: the file; content and extension have to agree.
        budget: bytes that the image may take; 60 % of the free memory when not given.

    Raises:
        InputError: there is no such file.
        FileFormatError: the file is damaged, or is none of PNG, OpenEXR, TIFF, JPEG, HDR
            and HEIC.
        ResourceLimitError: the image is larger than the budget; nothing was allocated.
    """
    pixels = read_pixels(Path(path), budget=budget)
    return pixels[..., 0] if pixels.shape[2] == 1 else pixels


def _codes(image: NDArray[np.generic]) -> NDArray[np.uint8]:
    pixels = image[..., np.newaxis] if image.ndim == 2 else image
    if pixels.ndim != 3 or pixels.shape[2] not in _CHANNELS or pixels.size == 0:
        raise ShapeError(
            f"write_png: image has shape {image.shape}, wanted (y, x) or (y, x, 1, 3 or 4)"
        )
    if pixels.dtype == np.uint8:
        return np.asarray(pixels, np.uint8)
    if pixels.dtype.kind != "f":
        raise DTypeError(
            f"write_png: image holds {pixels.dtype}, wanted real numbers in [0, 1] or uint8"
        )
    values = np.asarray(pixels, np.float64)
    if not np.isfinite(values).all():
        raise NonFiniteError("write_png: image holds NaN or infinity, wanted numbers in [0, 1]")
    return np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)
