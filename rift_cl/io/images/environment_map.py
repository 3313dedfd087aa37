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
# How much less than none light may be, as a share of the whole: filters ring by some.
_LEAST = 0.01
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
    is as blurred, and does not ripple. What a mirror shows of that has the picture's sum in linear
    light.

    Args:
        path: a picture twice as wide as high; OpenEXR and HDR in linear light, others in display
            light.
        lobes: of the scene's own light.
        display: whether the radiance shall be in display light.

    Raises:
        InputError: there is no such file, or its picture has another shape or two channels, or its
            negative numbers add up to more than 1 % of its light; fewer become 0.
        FileFormatError: it is damaged, or no picture.
        NonFiniteError: it holds NaN or infinity.
    """
    light, weights = _sampled(_linear_picture(path))
    directions, _ = _directions(len(light))
    light = light.reshape(-1, 3)
    wanted = _in_display_light(light) if display else light
    found = environment_of(wanted, directions, weights, lobes)
    off = weights @ (light_from(found, directions) - wanted) ** 2
    if off.sum() > _EXACT**2 * (weights @ wanted**2).sum():
        found = _denser(light, directions, weights, lobes, display=display)
    return found.astype(np.float32)


def _linear_picture(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """The picture (y, x, 3) in linear light, none of it negative; see ``read_environment_map``."""
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
    light = np.ascontiguousarray(picture[..., :3], np.float32)
    below = float(-np.minimum(light, 0).sum(dtype=np.float64))
    light = np.maximum(light, 0)
    if below > _LEAST * light.sum(dtype=np.float64):
        raise InputError(
            f"{path}: holds negative light, which adds up to {below:.3g} for "
            f"{light.sum(dtype=np.float64):.3g} of the positive: it is no picture of a light, or "
            "set what is below 0 to 0"
        )
    if Path(path).suffix.lower() not in _LINEAR:
        to_linear(light)
    return light


def _sampled(picture: NDArray[np.float32]) -> tuple[Floats, Floats]:
    """A picture of 64 rows at most, and the solid angles (M,) of its pixels, to a factor.

    Its pixels are means over solid angles: a small lamp neither falls between two nor, near a
    pole, changes its power.
    """
    across = np.sin(_polar(len(picture)))[:, None]
    if len(picture) > _MOST_ROWS:
        size = (_MOST_ROWS, 2 * _MOST_ROWS)
        power = picture * across[..., None].astype(np.float32)
        across = resize_local_mean(across, (_MOST_ROWS, 1))
        picture = resize_local_mean(power, size, channel_axis=2) / across[..., None]
    return picture.astype(float), np.repeat(across, picture.shape[1])


def _denser(
    light: Floats, directions: Floats, weights: Floats, lobes: int, *, display: bool
) -> Floats:
    """A light of ``picture_lobes`` that ``blunted`` mirrors show as sharp as one of ``lobes``.

    Light adds up and display light does not: a lamp is blurred in linear light, or it would lose
    most of its power to the curve. What is blurred so is smooth in display light as well.

    Args:
        light: (M, 3) linear light.
        directions: (M, 3) where it comes from.
        weights: (M,) solid angles, to a factor.
        lobes: of the scene's own light.
        display: whether the radiance shall be in display light.
    """
    dense = picture_lobes(lobes)
    found = environment_of(light, directions, weights, dense, lobes)
    if not display:
        return found
    directions, weights = _directions(_MOST_ROWS)
    blurred = _in_display_light(light_from(found, directions, lobes))
    return environment_of(blurred, directions, weights, dense, lobes)


def _in_display_light(light: Floats) -> Floats:
    curved = light.astype(np.float32)
    to_display(curved)
    return curved.astype(float)


def _directions(rows: int) -> tuple[Floats, Floats]:
    """Unit vectors (M, 3) of the pixels of a picture, row by row, and their solid angles."""
    azimuth = np.pi * (1 - (np.arange(2 * rows) + 0.5) / rows)
    high, round_ = np.meshgrid(_polar(rows), azimuth, indexing="ij")
    across = np.sin(high)
    found = np.stack([across * np.cos(round_), across * np.sin(round_), np.cos(high)], -1)
    return found.reshape(-1, 3), across.ravel()


def _polar(rows: int) -> Floats:
    """The polar angles of a picture's rows."""
    return np.asarray(np.pi * (np.arange(rows) + 0.5) / rows)
