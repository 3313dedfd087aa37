"""The pixels of a view: as a pinhole would have seen them, at the size that is asked for.

Photographs are averaged and resampled in linear light with alpha multiplied in, because that is
what light and coverage do; what comes out has straight alpha. What a mask hides is no part of such
a mean: alpha says where a scene is empty, a mask where nobody knows.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, NonFiniteError, ShapeError
from rift_cl.io.boundary import check_claim
from rift_cl.io.captures.view import View, camera_at
from rift_cl.io.images.display_light import LightKind, to_display, to_linear
from rift_cl.io.images.image_format import SUFFIXES
from rift_cl.io.images.picture_header import PictureHeader
from rift_cl.io.images.read_picture import read_picture_header, read_pixels
from rift_cl.io.images.resample import shrunk, undistorted

Image = NDArray[np.float32]

# By EXIF's orientation: quarter turns against the clock, and whether rows are then reversed.
_SHOWN = {
    1: (0, False),
    2: (2, True),
    3: (2, False),
    4: (0, True),
    5: (1, True),
    6: (-1, False),
    7: (-1, True),
    8: (1, False),
}
# The format that does not keep every code, and what is white in a mask of it.
_LOSSY, _HALF = "jpeg", 0.5
# The code 1 of 8 bits, with room for rounding.
_ONE_CODE = 1.01 / 255
# So many greys in a dark mask, black among them, may be labels; one with soft edges has more.
_LABELS = 32


def read_view(
    view: View, *, downscale: int = 1, light: LightKind = "display", budget: int | None = None
) -> Image:
    """Read the photograph of a view, without its lens, as ``camera_at(view, downscale)`` sees it.

    Rows and columns are those of the file, because poses refer to pixels as they are stored: COLMAP
    does not turn photographs in any release (its pull request 1318 did, 1406 took it back before
    3.7 came out), nor do nerfstudio (``-noautorotate`` in its pull request 1261) and instant-ngp.
    EXIF's orientation is followed where the view says that its camera belongs to the photograph as
    it is shown (``View.upright``), as those that 'rift fit' finds do, or has that size, rows and
    columns swapped. A mask of the stored photograph's size is turned with it, another is not.

    Args:
        view: one of the views of a capture.
        downscale: whole factor to make the image smaller by; areas are averaged.
        light: "display" for sRGB codes in [0, 1], "linear" for numbers proportional to light.
            OpenEXR, HDR, floating TIFF and PNG of gamma 1 count as linear on disk, everything else
            as display.
        budget: bytes that the reading may take; 60 % of the free memory when not given.

    Returns:
        float32 (y, x, 3), or (y, x, 4) with straight alpha where the photograph has alpha, a
        mask, a lens or a ``crop_radius``. Alpha is 0 where a mask is black and where the
        photograph does not reach; ``read_known_view`` tells these from what is transparent.

    Raises:
        InputError: an image is missing, or an argument makes no sense.
        FileFormatError: an image is damaged, or has no meaning as a photograph or mask.
        ShapeError: its size is not that of the camera.
        NonFiniteError: it holds NaN or infinity.
        ResourceLimitError: it is larger than the budget; nothing was allocated.
    """
    image, known = read_known_view(view, downscale=downscale, light=light, budget=budget)
    if known is None:
        return image
    image = _with_alpha(image)
    image[..., 3] *= known
    return image


def read_known_view(
    view: View, *, downscale: int = 1, light: LightKind = "display", budget: int | None = None
) -> tuple[Image, Image | None]:
    """Read a photograph as ``read_view`` does, and beside it how much of each pixel is known.

    What is transparent is known to be empty. Of what a mask hides, what a fisheye does not fill of
    its photograph, or what the photograph does not reach once its lens is undone, nothing is known.

    Args:
        view: one of the views of a capture.
        downscale: whole factor to make the image smaller by; areas are averaged.
        light: "display" or "linear"; see ``read_view``.
        budget: bytes that the reading may take; 60 % of the free memory when not given.

    Returns:
        float32 (y, x, 3), or (y, x, 4) with straight alpha where the photograph has alpha of its
        own: the means of what is known of each pixel. And float32 (y, x), the share of each pixel
        that is known, from 0 to 1; None for a photograph without mask, lens and
        ``crop_radius``, all of which is.

    Raises:
        RiftError: as ``read_view`` does.
    """
    if light not in ("display", "linear"):
        raise InputError(f"read_view: light is {light!r}, wanted 'display' or 'linear'")
    camera_at(view, downscale)
    header = _checked_header(view, budget)
    turn = header.orientation if view.upright or header.size != view.camera.size else 1
    image = upright(read_photograph(view.image, header, budget), turn)
    known = _known_before_lens(view, header, turn, budget)
    if downscale == 1 and view.lens is None:
        return _converted(image, linear=header.linear, wanted=light), known
    image = _converted(image, linear=header.linear, wanted="linear")
    if view.lens is not None and known is None:
        known = np.ones(image.shape[:2], np.float32)
    with_alpha = image.shape[2] == 4
    if with_alpha:
        image[..., :3] *= image[..., 3:]
    if known is not None:
        image *= known[..., np.newaxis]
        image = np.dstack([image, known])
    if view.lens is not None:
        image = undistorted(image, view.lens)
    image = shrunk(image, int(downscale))
    if known is not None:
        image, known = _split(image)
        _divide(image, known)
    if with_alpha:
        _divide(image[..., :3], image[..., 3])
    return _converted(image, linear=True, wanted=light), known


def _known_before_lens(
    view: View, header: PictureHeader, turn: int, budget: int | None
) -> Image | None:
    """How much of each pixel of the photograph is known, before its lens is undone."""
    known = None
    if view.mask is not None:
        known = _coverage(view.mask, budget)
        known = upright(known, turn) if known.shape == header.size else known
    if view.crop_radius is None:
        return known
    circle = _circle(view.camera.size, view.crop_radius)
    return circle if known is None else np.multiply(known, circle, out=known)


def _circle(size: tuple[int, int], radius: float) -> Image:
    """1 within a radius of the middle of a picture, 0 outside; a pixel is where its centre is."""
    y, x = (np.arange(extent) + 0.5 - extent / 2 for extent in size)
    return np.asarray(np.hypot(x, y[:, np.newaxis]) < radius, np.float32)


def _checked_header(view: View, budget: int | None) -> PictureHeader:
    """The photograph's header, once photograph and mask were found to fit the camera."""
    header = read_picture_header(view.image)
    size = view.camera.size
    fits = size == header.shown_size or (size == header.size and not view.upright)
    way_out = "" if fits else _rescaled(header.shown_size, size)
    _demand_fit(view, view.image, header, fits, way_out)
    # Numbers that are held for a pixel at one time: as stored, as RGBA, without the lens, a mask.
    numbers = header.channels + 4 + (0 if view.lens is None else 8)
    if view.mask is not None:
        mask = read_picture_header(view.mask)
        _demand_fit(view, view.mask, mask, mask.size in (size, header.size))
        numbers += mask.channels + 2
    if view.crop_radius is not None:
        numbers += 2
    need = 4 * numbers * view.camera.height * view.camera.width
    check_claim(view.image, "the view, with what it is made of,", need, budget)
    return header


def _demand_fit(
    view: View, path: Path, header: PictureHeader, fits: bool, way_out: str = ""
) -> None:
    check_colors(path, header)
    if not fits:
        raise ShapeError(
            f"{path}: is {_size(header.size)} pixels, the camera of view {view.name!r} says "
            f"{_size(view.camera.size)}{way_out}"
        )


def _rescaled(size: tuple[int, int], wanted: tuple[int, int]) -> str:
    """What to do with a photograph that was made smaller or larger; the end of a sentence."""
    scale = math.sqrt(math.prod(size) / math.prod(wanted))
    if any(abs(scale * extent - found) > 1 for extent, found in zip(wanted, size, strict=True)):
        return "; the photograph may be a crop, or another one"
    factor = round(1 / scale)
    intrinsics = f"multiply size, focal lengths and principal point of the camera by {scale:.4g}"
    if factor <= 1:
        return f"; it has the same shape: {intrinsics}"
    return (
        f"; it has the same shape: take the photographs that the camera was found for, and "
        f"downscale={factor} (--downscale {factor}) to fit them smaller, or {intrinsics}"
    )


def upright(image: Image, orientation: int) -> Image:
    """An image (y, x, ...) as it is shown where EXIF says this of its orientation, 1 to 8."""
    turns, flipped = _SHOWN[orientation]
    shown = np.rot90(image, turns)
    return np.ascontiguousarray(shown[::-1] if flipped else shown)


def check_colors(path: Path, header: PictureHeader) -> None:
    """Refuse a picture that is neither grey nor RGB.

    Raises:
        FileFormatError: it has another number of channels.
    """
    if header.channels - header.alpha not in (1, 3):
        raise FileFormatError(
            f"{path}: has {header.channels} channels, wanted grey or RGB, with alpha or without"
        )


def _size(size: tuple[int, int]) -> str:
    return f"{size[1]} x {size[0]} (width x height)"


def read_photograph(path: Path, header: PictureHeader, budget: int | None) -> Image:
    """A photograph as RGB or RGBA with straight alpha, in the light that it is stored in.

    Raises:
        FileFormatError: it is damaged.
        NonFiniteError: it holds NaN or infinity.
        ResourceLimitError: it is larger than the budget.
    """
    image = read_pixels(path, budget=budget)
    if header.linear and not np.isfinite(image).all():
        raise NonFiniteError(f"{path}: the image holds NaN or infinity")
    if header.channels <= 2:
        image = np.take(image, [0, 0, 0, 1][: 3 + header.alpha], axis=2)
    if header.alpha:
        np.clip(image[..., 3], 0, 1, out=image[..., 3])
    return image


def _coverage(path: Path, budget: int | None) -> Image:
    """A mask (y, x): how much of each pixel counts, from 0 to 1.

    Where alpha varies and colours do not, alpha is the mask; else their product is.

    Raises:
        FileFormatError: the file is damaged, or nothing in it tells what counts, as in one of
            labels.
        NonFiniteError: it holds NaN or infinity.
    """
    header = read_picture_header(path)
    codes = read_pixels(path, budget=budget)
    if not np.isfinite(codes).all():
        raise NonFiniteError(f"{path}: the mask holds NaN or infinity")
    colors = codes[..., :-1] if header.alpha else codes
    if not header.floating and 0 < colors.max() <= _ONE_CODE:
        raise FileFormatError(
            f"{path}: the mask has no code above 1, so that all of it is black; write 255 where "
            "the photograph counts"
        )
    mask: Image = colors.mean(axis=-1, dtype=np.float32)
    if header.alpha:
        mask = _with_own_alpha(path, mask, codes[..., -1])
    if SUFFIXES[path.suffix.lower()] == _LOSSY:
        # Black and white come back as greys wherever an edge is near.
        return (mask > _HALF).astype(np.float32)
    if not header.floating:
        _check_no_labels(path, mask, colors)
    return np.clip(mask, 0, 1)


def _check_no_labels(path: Path, mask: Image, colors: Image) -> None:
    """Refuse a mask of labels, by colour or number, whose mean over channels tells of no cover.

    Raises:
        FileFormatError: no pixel is brighter than half, and the mask has colours or few greys.
    """
    most = float(mask.max())
    if not 0 < most <= _HALF:
        return
    if np.ptp(colors, axis=-1).max() > _ONE_CODE or len(np.unique(mask)) <= _LABELS:
        raise FileFormatError(
            f"{path}: no pixel of the mask is brighter than {100 * most:.2g} % of white, as where "
            "colours or numbers label what is shown; write 255 in all channels where the "
            "photograph counts, 0 elsewhere"
        )


def _with_own_alpha(path: Path, mask: Image, alpha: Image) -> Image:
    """A mask that has alpha; see ``_coverage``."""
    if np.ptp(mask):
        return mask * alpha
    if np.ptp(alpha):
        return alpha
    if not mask.any():
        raise FileFormatError(
            f"{path}: the mask is black in all of its colours and has one alpha, so that nothing "
            "tells what counts; write it without alpha, white where the photograph counts"
        )
    return mask * alpha


def _with_alpha(image: Image) -> Image:
    if image.shape[2] == 4:
        return image
    full = np.ones((*image.shape[:2], 4), np.float32)
    full[..., :3] = image
    return full


def _split(image: Image) -> tuple[Image, Image]:
    """All channels but the last, and the last."""
    return np.ascontiguousarray(image[..., :-1]), np.ascontiguousarray(image[..., -1])


def _divide(image: Image, share: Image) -> None:
    """Divide channels (y, x, channel) by what was multiplied into them, where that is not 0."""
    divisor = share[..., np.newaxis]
    np.divide(image, divisor, out=image, where=divisor > 0)


def _converted(image: Image, *, linear: bool, wanted: LightKind) -> Image:
    colors = image[..., :3]
    if linear and wanted == "display":
        to_display(colors)
    elif not linear and wanted == "linear":
        to_linear(colors)
    return image
