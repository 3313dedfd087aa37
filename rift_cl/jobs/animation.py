"""Frames as one moving picture: an animated PNG, which every browser plays and keeps every colour.

Whatever does not know the animated kind shows its first frame.
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError


def shrunk(image: NDArray[np.float32], edge: int) -> NDArray[np.uint8]:
    """8-bit codes of a picture of which the longer edge has at most so many pixels."""
    from PIL import Image

    codes = Image.fromarray(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8))
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
    from PIL import Image

    if not frames:
        raise InputError("animated_png: there are no frames")
    first, *others = (Image.fromarray(frame) for frame in frames)
    buffer = io.BytesIO()
    first.save(
        buffer,
        format="PNG",
        save_all=True,
        append_images=others,
        duration=round(1000 / rate),
        loop=0,
    )
    return buffer.getvalue()
