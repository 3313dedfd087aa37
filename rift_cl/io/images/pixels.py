"""Pixels through OpenImageIO: one function in, one out, no error left unread, alpha straight.

OpenImageIO reports failure by return values, and for some formats by ``geterror`` alone: a PNG on
a full disk counts as written otherwise. On the way in it would try every decoder it has on a file
that the first one refuses, so the few formats wanted here are recognised before it is asked. HEIC,
which its wheels lack, goes through pi-heif. Pictures are read here in a child process alone
(``read_picture``).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.images.heic import heic_codes, opened_heic
from rift_cl.io.images.image_format import HEIC


def write_pixels(
    path: Path, pixels: NDArray[Any], *, format: str, attributes: Mapping[str, Any]
) -> None:
    """Write (y, x, channel), uint8 or float32, in a format that the file's name need not show.

    Raises:
        OSError: any step failed; what was written is no picture.
    """
    high, wide, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(
        wide, high, channels, "uint8" if pixels.dtype == np.uint8 else "float"
    )
    # Otherwise TIFF and OpenEXR get the time of writing, and no two runs the same bytes.
    spec.attribute("DateTime", "")
    for name, value in attributes.items():
        spec.attribute(name, value)
    output = OpenImageIO.ImageOutput.create(format)
    if output is None:
        raise OSError(f"OpenImageIO cannot write {format}")
    done = output.open(_name(path), spec)
    if done:
        done = output.write_image(np.ascontiguousarray(pixels))
        done = output.close() and done
    message = first_line(output.geterror())
    if not done or message:
        raise OSError(message or "OpenImageIO gives no reason")


def decode_pixels(path: Path, format: str, budget: int) -> NDArray[np.float32]:
    """Read (y, x, channel) as float32; integers are scaled to [0, 1], alpha is not multiplied in.

    OpenEXR and most TIFF hold colours with alpha multiplied in; they are divided by it, in the
    light that they are stored in. Where alpha is 0 there is nothing to divide by: what is stored
    there, light that covers nothing, is returned as it is.

    Rows and columns are those of the file: an EXIF orientation turns nothing (see ``read_view``).

    Raises:
        FileFormatError: the file is damaged.
        ResourceLimitError: the image is larger than the budget; nothing was allocated.
    """
    with reading(path, "the image"):
        return _heic(path, budget) if format == HEIC else _opened(path, format, budget)


def _heic(path: Path, budget: int) -> NDArray[np.float32]:
    picture = opened_heic(path)
    width, height = picture.size
    check_claim(path, "the image", 5 * width * height * len(picture.mode), budget)
    return heic_codes(picture).astype(np.float32) / np.float32(255)


def _opened(path: Path, format: str, budget: int) -> NDArray[np.float32]:
    """The pixels of a file that OpenImageIO reads; see ``decode_pixels``."""
    with opened_image(path, format) as source:
        spec = source.spec()
        if spec.deep or spec.depth > 1:
            raise FileFormatError(f"{path}: holds deep pixels, a flat image is wanted")
        if spec.tile_width and str(spec.format) == "double":
            # OpenImageIO 3.2 gives back memory that it never filled.
            raise FileFormatError(f"{path}: float64 in tiles; save it in strips, or as float32")
        check_claim(path, "the image", spec.width * spec.height * spec.nchannels * 4, budget)
        pixels = source.read_image("float")
        message = first_line(source.geterror())
        if pixels is None or message:
            raise FileFormatError(f"{path}: the image is damaged ({message})")
        shape = (spec.height, spec.width, spec.nchannels)
        return _straight(np.asarray(pixels, np.float32).reshape(shape), spec)


@contextmanager
def opened_image(path: Path, format: str) -> Iterator[Any]:
    """The file as OpenImageIO's input, its alpha not multiplied in.

    Raises:
        FileFormatError: it is damaged, or of another format than this.
        ResourceLimitError: it is larger than OpenImageIO's own limit.
    """
    config = OpenImageIO.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    every = OpenImageIO.get_int_attribute("try_all_readers", 1)
    OpenImageIO.attribute("try_all_readers", 0)
    try:
        source = OpenImageIO.ImageInput.open(_name(path), config)
    finally:
        OpenImageIO.attribute("try_all_readers", every)
    if source is None:
        message = first_line(OpenImageIO.geterror())
        kind = ResourceLimitError if "limits:imagesize" in message else FileFormatError
        raise kind(f"{path}: the image cannot be read ({message})")
    try:
        if source.format_name() != format:
            raise FileFormatError(f"{path}: was taken for {source.format_name()}, it is {format}")
        yield source
    finally:
        source.close()


def _name(path: Path) -> str:
    """A file's name as OpenImageIO wants it, UTF-8, whatever Python takes names for.

    Raises:
        InputError: the name is not UTF-8.
    """
    try:
        return os.fsencode(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: the name of an image has to be UTF-8, which this is not: rename it"
        ) from error


def _straight(pixels: NDArray[np.float32], spec: Any) -> NDArray[np.float32]:
    """Divide colours by the alpha that is multiplied into them; changes what it is given."""
    alpha = spec.alpha_channel
    if alpha < 0 or spec.get_int_attribute("oiio:UnassociatedAlpha", 0):
        return pixels
    cover = pixels[..., alpha]
    with np.errstate(over="ignore"):
        for channel in set(range(spec.nchannels)) - {alpha, spec.z_channel}:
            color = pixels[..., channel]
            np.divide(color, cover, out=color, where=cover > 0)
    return pixels


def first_line(message: str) -> str:
    """What OpenImageIO says first; it repeats itself on further lines."""
    return (message.strip().splitlines() or [""])[0]
