"""Pixels and headers of pictures, which a child process decodes (``rift_cl.io.decoder``)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import free_host_memory
from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import HOST_SHARE, reading
from rift_cl.io.decoder import Decoder
from rift_cl.io.images.heic import check_heic
from rift_cl.io.images.image_format import HEIC, image_format
from rift_cl.io.images.picture_header import PictureHeader

# Where nothing tells how much memory there is.
_ANY = 1 << 40
# One child for all pictures, which is started for the first.
_DECODER = Decoder()


def read_pixels(path: Path, *, budget: int | None = None) -> NDArray[np.float32]:
    """Read (y, x, channel) as float32; integers are scaled to [0, 1], alpha is not multiplied in.

    See ``rift_cl.io.images.pixels.decode_pixels``.

    Args:
        path: the file.
        budget: bytes that the image may take; 60 % of the free memory when not given.

    Raises:
        InputError: there is no such file, or pi-heif is wanted and not installed.
        FileFormatError: the file is damaged, or is none of PNG, OpenEXR, TIFF, JPEG, HDR and HEIC.
        ResourceLimitError: the image is larger than the budget; nothing was allocated.
    """
    if budget is None:
        free = free_host_memory()
        # The child has the image too until it is here.
        budget = _ANY if free is None else int(HOST_SHARE * free) // 2
    answer, data = _decoded(path, "pixels", longest=budget, budget=budget)
    shape = tuple(map(int, answer["shape"]))
    if 4 * math.prod(shape) != len(data):
        raise FileFormatError(f"{path}: the decoder gave {len(data)} bytes for pixels of {shape}")
    return np.frombuffer(data, np.float32).reshape(shape)


def read_picture_header(path: Path) -> PictureHeader:
    """Read the header of a PNG, OpenEXR, TIFF, JPEG, HDR or HEIC.

    Raises:
        InputError: there is no such file, or pi-heif is wanted and not installed.
        FileFormatError: the file is damaged, or is none of these.
    """
    header = _decoded(path, "header")[0]["header"]
    lists = {name: tuple(value) for name, value in header.items() if isinstance(value, list)}
    return PictureHeader(**{**header, **lists})


def _decoded(
    path: Path, task: str, longest: int = 0, **more: Any
) -> tuple[dict[str, Any], bytearray]:
    with reading(path, "the image"):
        format = image_format(path)
        if format == HEIC:
            check_heic(path)
    return _DECODER.decode(path, task, longest, format=format, **more)
