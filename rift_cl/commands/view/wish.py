"""What a page's panels ask for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rift_cl.commands.view.crop import Crop
from rift_cl.commands.view.photographs import Comparison, Photograph
from rift_cl.geometry import Aperture
from rift_cl.splat.settings import SplatSettings

Kind = Literal["colour", "depth"]
KINDS: tuple[Kind, ...] = ("colour", "depth")


def kinds_of(settings: SplatSettings) -> tuple[Kind, ...]:
    """What can be shown of splats that are rendered so: nothing is before anything in X-rays."""
    return KINDS[:1] if settings.mode == "xray" else KINDS


@dataclass(frozen=True)
class Wish:
    """A request for a picture.

    Args:
        kind: of picture.
        edge: longer edge of a picture whose camera rests, in pixels.
        aperture: that it is drawn through; None for a pinhole.
        crop: the box outside of which nothing is drawn, or None.
        comparison: with a photograph.
        share: of the photograph.
        photograph: that is compared with, or None.
    """

    kind: Kind = "colour"
    edge: int = 960
    aperture: Aperture | None = None
    crop: Crop | None = None
    comparison: Comparison = "off"
    share: float = 0.0
    photograph: Photograph | None = None
