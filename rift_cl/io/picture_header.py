"""What a picture says about itself before a pixel of it is decoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rift_cl.io.boundary import reading
from rift_cl.io.pixels import image_format, opened_image


@dataclass(frozen=True)
class PictureHeader:
    """The header of a picture.

    Args:
        size: (height, width) in pixels.
        channels: numbers in a pixel.
        alpha: the last of them is alpha.
        associated: alpha is multiplied into the colours.
        linear: the colours are proportional to light; integers are display light by custom.
    """

    size: tuple[int, int]
    channels: int
    alpha: bool
    associated: bool
    linear: bool


def read_picture_header(path: Path) -> PictureHeader:
    """Read the header of a PNG, OpenEXR, TIFF, JPEG or HDR.

    Raises:
        InputError: there is no such file.
        FileFormatError: the file is damaged, or is none of these.
    """
    with reading(path, "the image"), opened_image(path, image_format(path)) as source:
        spec = source.spec()
        alpha = spec.alpha_channel >= 0
        return PictureHeader(
            size=(int(spec.height), int(spec.width)),
            channels=int(spec.nchannels),
            alpha=alpha,
            associated=alpha and spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0,
            linear=str(spec.format) in ("half", "float", "double"),
        )
