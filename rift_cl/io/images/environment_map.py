"""An environment light as a picture: all directions in equirectangular projection, both ways.

The world's z axis is at the top and its x axis in the middle; y is to the left of it, as one sees
it from inside. Rows are polar angles, columns azimuths, in equal steps. What a fit's colours are in
display light is written in linear light, as OpenEXR has it by custom, and read back so.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skimage.transform import resize_local_mean

from rift_cl.basis.angular.environment import environment_of, light_from, picture_lobes
from rift_cl.cl.host_arrays import check_finite
from rift_cl.errors import InputError
from rift_cl.io.images.display_light import to_display, to_linear
from rift_cl.io.images.image import read_image
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.output import atomic_path

# Rows of a picture that is written, and most of one that a light is found from.
_ROWS, _MOST_ROWS = 128, 64
# What lobes may lack of a picture that is theirs, as a share of it, root mean square.
_EXACT = 0.02
# Formats whose numbers are linear light.
_LINEAR = (".exr", ".hdr")

Floats = NDArray[np.float64]


def write_environment_map(
    path: str | os.PathLike[str], environment: NDArray[np.float32], *, display: bool
) -> None:
    """Write a light as an OpenEXR picture, 128 rows of 256 directions.

    Args:
        path: the file, ``.exr``.
        environment: (K, 3) natural logarithms of the radiance of its lobes.
        display: whether that is in display light; it is written in linear light.

    Raises:
        OutputError: the file cannot be written.
    """
    directions, _ = _directions(_ROWS)
    light = light_from(environment.astype(float), directions).astype(np.float32)
    if display:
        to_linear(light)
    with atomic_path(Path(path)) as part:
        pixels = light.reshape(_ROWS, 2 * _ROWS, 3)
        write_pixels(part, pixels, format="openexr", attributes={})


def read_environment_map(
    path: str | os.PathLike[str], lobes: int, *, display: bool
) -> NDArray[np.float32]:
    """The light that a picture shows, as natural logarithms of radiance, (K, 3).

    K is ``lobes`` where such a light makes the picture, as it makes that of a fit, and otherwise
    ``picture_lobes`` of it, to be seen by surfaces that are ``blunted``: on a denser lattice light
    is as blurred, and does not ripple.

    Args:
        path: a picture twice as wide as high; OpenEXR and HDR in linear light, others in display
            light.
        lobes: of the scene's own light.
        display: whether the radiance shall be in display light.

    Raises:
        InputError: there is no such file, or its picture has another shape or two channels.
        FileFormatError: it is damaged, or no picture.
        NonFiniteError: it holds NaN or infinity.
    """
    picture = read_image(path)
    check_finite(picture, name=f"{path}: the picture")
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    rows, columns = picture.shape[:2]
    if picture.shape[2] < 3:
        raise InputError(
            f"{path}: has {picture.shape[2]} channels, wanted one (grey) or three (red, green and "
            "blue); further ones are not read"
        )
    if columns != 2 * rows:
        raise InputError(
            f"{path}: has {rows} rows of {columns} pixels, wanted a picture of all directions, "
            "twice as wide as high"
        )
    light = np.maximum(np.ascontiguousarray(picture[..., :3], np.float32), 0)
    if Path(path).suffix.lower() not in _LINEAR:
        to_linear(light)
    if rows > _MOST_ROWS:
        # A mean over each pixel: a small lamp must not fall between two.
        light = resize_local_mean(light, (_MOST_ROWS, 2 * _MOST_ROWS), channel_axis=2)
    if display:
        to_display(light)
    directions, weights = _directions(len(light))
    wanted = light.reshape(-1, 3).astype(float)
    found = environment_of(wanted, directions, weights, lobes)
    off = weights @ (light_from(found, directions) - wanted) ** 2
    if off.sum() > _EXACT**2 * (weights @ wanted**2).sum():
        found = environment_of(wanted, directions, weights, picture_lobes(lobes), lobes)
    return found.astype(np.float32)


def _directions(rows: int) -> tuple[Floats, Floats]:
    """Unit vectors (M, 3) of the pixels of a picture, row by row, and their solid angles."""
    polar = np.pi * (np.arange(rows) + 0.5) / rows
    azimuth = np.pi * (1 - (np.arange(2 * rows) + 0.5) / rows)
    high, round_ = np.meshgrid(polar, azimuth, indexing="ij")
    across = np.sin(high)
    found = np.stack([across * np.cos(round_), across * np.sin(round_), np.cos(high)], -1)
    return found.reshape(-1, 3), across.ravel()
