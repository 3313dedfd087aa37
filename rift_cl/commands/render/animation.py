"""Frames as one moving picture, and which kind of film that is to be.

An animated PNG needs no extra, plays in every browser and keeps every colour, but is large; an
animated WebP is small, for reports. Whatever does not know the animated kind shows its first frame.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.render.settings import FilmChoice
from rift_cl.errors import InputError
from rift_cl.io.images.film_file import FilmKind, check_films, films_can_be_written

# The shortest edge that every encoder takes, in pixels.
_SMALLEST = 4
# Quality of WebP: that of a small copy.
_QUALITY = 70


def chosen_film(
    asked: FilmChoice, sizes: Sequence[tuple[int, int]]
) -> FilmKind | Literal["apng"] | None:
    """The kind of a film of frames of these (height, width); None where nothing can move.

    WebM is taken by itself where it can be written, else an animated PNG.

    Raises:
        InputError: a kind was asked for that cannot be written, or frames differ in size.
    """
    moves, large = len(sizes) > 1 and len(set(sizes)) == 1, min(sizes[0]) >= _SMALLEST
    if asked == "auto":
        return None if not moves else "webm" if large and films_can_be_written() else "apng"
    if not moves:
        raise InputError(f"--film {asked} wants two frames or more, all of one size: give --size")
    if asked == "apng":
        return asked
    if not large:
        raise InputError(f"--film {asked} wants edges of {_SMALLEST} pixels or more: give --size")
    check_films(asked)
    return asked


def shrunk(image: NDArray[np.float32], edge: int) -> NDArray[np.uint8]:
    """8-bit codes of a picture of which the longer edge has at most so many pixels.

    A picture that was read from its PNG gives the same as the one that was written.
    """
    from PIL import Image

    values = np.clip(np.asarray(image, np.float64), 0, 1)
    codes = Image.fromarray(np.rint(values * 255).astype(np.uint8))
    codes.thumbnail((edge, edge), Image.Resampling.BOX, reducing_gap=None)
    return np.asarray(codes)


def animated_png(frames: Sequence[NDArray[np.uint8]], rate: float) -> bytes:
    """The content of an animated PNG that plays for ever.

    Args:
        frames: (height, width, 3) codes, all of one size.
        rate: frames in a second.

    Raises:
        InputError: there are no frames.
    """
    return _animated(frames, rate, "PNG")


def animated_webp(frames: Sequence[NDArray[np.uint8]], rate: float) -> bytes:
    """The content of an animated WebP, a copy with less quality; see ``animated_png``."""
    return _animated(frames, rate, "WEBP", quality=_QUALITY, method=3)


def _animated(frames: Sequence[NDArray[np.uint8]], rate: float, kind: str, **options: int) -> bytes:
    from PIL import Image

    if not frames:
        raise InputError("there are no frames to be set in motion")
    first, *others = (Image.fromarray(frame) for frame in frames)
    buffer = io.BytesIO()
    first.save(
        buffer,
        format=kind,
        save_all=True,
        append_images=others,
        duration=round(1000 / rate),
        loop=0,
        **options,
    )
    return buffer.getvalue()
