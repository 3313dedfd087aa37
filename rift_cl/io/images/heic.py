"""HEIC photographs, as phones take them, through pi-heif, which is an extra: codes of 8 bits.

pi-heif brings libheif and libde265 (LGPL). Its sister pillow-heif also brings an encoder under the
GPL, which is not wanted here. libheif turns pictures as the file says they are shown, so that rows
and columns are upright already; what EXIF says besides about the orientation does not count.
"""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, not_installed

# EXIF's numbers of the maker, the model, its own folder of facts, and the focal lengths in there.
_MAKE, _MODEL, _EXIF, _FOCALS = 271, 272, 0x8769, (0x920A, 0xA405)
# What a colour profile is called that has no name.
UNNAMED = "without a name"
# Primaries other than sRGB's by their number (ITU-T H.273), where there is no ICC profile.
_PRIMARIES = {9: "Rec. 2020", 12: "Display P3"}
# Bytes of boxes that are looked at; a phone's take a few thousand.
_MOST_BOXES = 16 << 20
# Bytes before the boxes in these boxes, by the version of those that have several.
_BEFORE_IN_META, _BEFORE_IN_IINF = 4, (6, 8)
# Bytes before an item's type, by the version of the box that describes it.
_BEFORE_TYPE = {2: 8, 3: 10}


def check_heic(path: Path) -> None:
    """Make sure that pi-heif is installed.

    Raises:
        InputError: it is not.
    """
    if find_spec("pi_heif") is None:
        what = f"{path}: HEIC photographs are read by"
        raise not_installed(what, "pi-heif", "pi-heif", "save them as JPEG")


def opened_heic(path: Path) -> Any:
    """The first picture of a file, not decoded yet.

    Raises:
        InputError: pi-heif is not installed.
        FileFormatError: it is neither grey nor RGB, or its items have types that are no text.
    """
    check_heic(path)
    _check_types(path)
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


def heic_profile(picture: Any) -> str:
    """The name of a picture's colour profile; empty where it has none."""
    profile = picture.info.get("icc_profile")
    if not profile:
        numbers = picture.info.get("nclx_profile") or {}
        return _PRIMARIES.get(numbers.get("color_primaries", 0), "")
    name = ""
    # Pixels do not hang on the profile either.
    with suppress(Exception):
        from PIL.ImageCms import ImageCmsProfile, getProfileDescription

        name = getProfileDescription(ImageCmsProfile(io.BytesIO(profile))).strip()
    return name or UNNAMED


def heic_codes(picture: Any) -> NDArray[np.uint8]:
    """Decode a picture: (y, x, channel), alpha straight."""
    codes = np.asarray(picture)
    return codes if codes.ndim == 3 else codes[..., np.newaxis]


def _check_types(path: Path) -> None:
    """Make sure that types and names of a file's items are text: pi-heif 1.4.0 dies of others.

    Whatever else is wrong with the boxes (ISO 14496-12, 8.11) is libheif's to tell.

    Raises:
        FileFormatError: they are not.
    """
    with path.open("rb") as file:
        content = memoryview(file.read(_MOST_BOXES))
    metas = (box[_BEFORE_IN_META:] for kind, box in _boxes(content) if kind == b"meta")
    lists = (box for meta in metas for kind, box in _boxes(meta) if kind == b"iinf")
    for items in lists:
        for kind, item in _boxes(items[_BEFORE_IN_IINF[bool(items[0])] :]):
            if kind != b"infe" or item[0] not in _BEFORE_TYPE:
                continue
            try:
                str(item[_BEFORE_TYPE[item[0]] :], "utf-8")
            except UnicodeDecodeError:
                raise FileFormatError(
                    f"{path}: an item's type or name is no text: the file is damaged"
                ) from None


def _boxes(content: memoryview) -> Iterator[tuple[bytes, memoryview]]:
    """Boxes that stand one after the other, as far as they are whole and hold anything."""
    while len(content) >= 8:
        size, kind, start = *struct.unpack_from(">I4s", content), 8
        if size == 1 and len(content) >= 16:
            size, start = struct.unpack_from(">Q", content, 8)[0], 16
        size = size or len(content)
        if not start < size <= len(content):
            return
        yield kind, content[start:size]
        content = content[size:]
