"""What a picture says about itself before a pixel of it is decoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rift_cl.io.boundary import reading
from rift_cl.io.images.heic import UNNAMED, heic_profile, heic_taken_by, opened_heic
from rift_cl.io.images.image_format import HEIC
from rift_cl.io.images.pixels import opened_image
from rift_cl.io.images.primaries import png_primaries, unlike_srgb

# Beginnings of OpenImageIO's names for the curve and the primaries of sRGB, or nearly them.
_SRGB = ("srgb_rec709", "g22_rec709", "gamma2.2")
# What EXIF says of colours that are neither sRGB nor, by its own words, anything else.
_UNCALIBRATED = 65535
# What Facebook calls the small profile of sRGB in its photographs.
_SMALL_SRGB = "c2"
_TAKEN_BY = ("Make", "Model", "Exif:FocalLength", "Exif:FocalLengthIn35mmFilm")


@dataclass(frozen=True)
class PictureHeader:
    """The header of a picture.

    Args:
        size: (height, width) in pixels.
        channels: numbers in a pixel.
        alpha: the last of them is alpha.
        linear: the colours are proportional to light; integers are display light by custom, unless
            the file says that their gamma is 1.
        floating: the numbers are real ones, not codes.
        eight_bit: each number is a code of 8 bits.
        orientation: how EXIF wants it shown: 1 as it is stored, 3 turned by half, 2 and 4 mirrored,
            5 to 8 with the axes swapped. HEIC comes turned from its decoder, and is 1 here.
        taken_by: maker and model of the camera and its focal lengths, as EXIF has them; empty
            where it has none.
        profile: the name of the colour profile, colour space or primaries that the file says its
            numbers are in; empty where that is sRGB's or linear light of its primaries, or nothing
            is said.
    """

    size: tuple[int, int]
    channels: int
    alpha: bool
    linear: bool
    floating: bool
    eight_bit: bool
    orientation: int
    taken_by: tuple[str, ...]
    profile: str

    @property
    def sideways(self) -> bool:
        """EXIF wants it shown with rows and columns swapped."""
        return self.orientation >= 5

    @property
    def shown_size(self) -> tuple[int, int]:
        """(height, width) as EXIF wants it shown."""
        return (self.size[1], self.size[0]) if self.sideways else self.size


def decode_header(path: Path, format: str) -> PictureHeader:
    """Read the header of a picture.

    Raises:
        FileFormatError: the file is damaged.
    """
    with reading(path, "the image"):
        return _heic_header(path) if format == HEIC else _header(path, format)


def _heic_header(path: Path) -> PictureHeader:
    picture = opened_heic(path)
    return PictureHeader(
        size=picture.size[::-1],
        channels=len(picture.mode),
        alpha=picture.mode.endswith("A"),
        linear=False,
        floating=False,
        eight_bit=True,
        orientation=1,
        taken_by=heic_taken_by(picture),
        profile=_unlike_srgb(heic_profile(picture)),
    )


def _header(path: Path, format: str) -> PictureHeader:
    with opened_image(path, format) as source:
        spec = source.spec()
        orientation = int(spec.get_int_attribute("Orientation", 1))
        taken_by = (spec.getattribute(name) for name in _TAKEN_BY)
        floating = str(spec.format) in ("half", "float", "double")
        space = spec.get_string_attribute("oiio:ColorSpace").lower()
        return PictureHeader(
            size=(int(spec.height), int(spec.width)),
            channels=int(spec.nchannels),
            alpha=spec.alpha_channel >= 0,
            linear=floating or space.startswith("lin"),
            floating=floating,
            eight_bit=str(spec.format) == "uint8",
            orientation=orientation if 1 <= orientation <= 8 else 1,
            taken_by=tuple(str(value) for value in taken_by if value is not None),
            profile=_of_light(spec) if floating else _profile(path, spec, space),
        )


def _of_light(spec: Any) -> str:
    """The primaries of floating-point numbers, where they are stated and not those of sRGB."""
    stated = spec.getattribute("chromaticities")
    fits = isinstance(stated, tuple) and len(stated) == 8
    return unlike_srgb(stated) if fits else ""


def _profile(path: Path, spec: Any, space: str) -> str:
    """The profile of codes, or else their colour space, where that is neither sRGB nor linear."""
    if spec.getattribute("ICCProfile") is not None:
        name = spec.get_string_attribute("ICCProfile:profile_description")
        return _unlike_srgb(name or UNNAMED)
    if spec.get_int_attribute("Exif:ColorSpace", 0) == _UNCALIBRATED:
        return "uncalibrated, as cameras mark Adobe RGB"
    stated = png_primaries(path) if path.suffix.lower() == ".png" else None
    if stated is not None and (name := unlike_srgb(stated)):
        return name
    if space in ("", "srgb") or space.startswith(("lin", *_SRGB)):
        return ""
    gamma = spec.get_float_attribute("oiio:Gamma", 0.0)
    return f"gamma {gamma:.3g}" if gamma else space


def _unlike_srgb(name: str) -> str:
    """The name of a profile; empty where it is sRGB's."""
    plain = name.lower()
    alike = plain == _SMALL_SRGB or ("srgb" in plain and "linear" not in plain)
    return "" if alike else name
