"""HEIC photographs, as phones take them, through pi-heif, which is an extra: codes of 8 bits.

pi-heif brings libheif and libde265 (LGPL). Its sister pillow-heif also brings an encoder under the
GPL, which is not wanted here. libheif turns pictures as the file says they are shown, so that rows
and columns are upright already; what EXIF says besides about the orientation does not count.
"""

from __future__ import annotations

import warnings
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError

# Brands of pictures that are coded in HEVC, which is what libheif decodes there.
BRANDS = (b"heic", b"heix", b"heim", b"heis", b"mif1")
# EXIF's numbers of the maker, the model, its own folder of facts, and the focal lengths in there.
_MAKE, _MODEL, _EXIF, _FOCALS = 271, 272, 0x8769, (0x920A, 0xA405)


def check_heic(path: Path) -> None:
    """Make sure that pi-heif is installed.

    Raises:
        InputError: it is not.
    """
    if find_spec("pi_heif") is None:
        raise InputError(
            f"{path}: HEIC photographs are read by pi-heif, which is not installed: pip install "
            "pi-heif (or '.[heic]' where the source is), or save them as JPEG"
        )


def opened_heic(path: Path) -> Any:
    """The first picture of a file, not decoded yet.

    Raises:
        InputError: pi-heif is not installed.
        FileFormatError: it is neither grey nor RGB.
    """
    check_heic(path)
    from pi_heif import open_heif

    picture = open_heif(path)
    if picture.mode not in ("L", "LA", "RGB", "RGBA"):
        raise FileFormatError(f"{path}: holds {picture.mode} pixels, wanted grey or RGB")
    return picture


def heic_taken_by(picture: Any) -> tuple[str, ...]:
    """Maker and model of the camera and its focal lengths, as far as EXIF can be read."""
    from PIL.Image import Exif

    facts, values = Exif(), []
    # Pixels do not hang on EXIF, so that nothing that is wrong with it may cost them.
    with warnings.catch_warnings(), suppress(Exception):
        warnings.simplefilter("ignore")
        facts.load(picture.info.get("exif") or b"")
        more = facts.get_ifd(_EXIF)
        values = [*(facts.get(number) for number in (_MAKE, _MODEL)), *map(more.get, _FOCALS)]
    return tuple(str(value) for value in values if value is not None)


def heic_codes(picture: Any) -> NDArray[np.uint8]:
    """Decode a picture: (y, x, channel), alpha straight."""
    codes = np.asarray(picture)
    return codes if codes.ndim == 3 else codes[..., np.newaxis]
