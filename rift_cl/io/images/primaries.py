"""The colours that a picture's red, green, blue and white stand for, where no profile says it.

OpenEXR has them in ``chromaticities``, PNG in its chunk ``cHRM`` (W3C, Portable Network Graphics,
third edition, 11.3.2.1), which OpenImageIO does not read. Here they are only told apart from
sRGB's, and not converted: how to go from one white to another is a matter of choice.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

# x and y of red, green, blue and white.
_SRGB = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
_KNOWN = {
    "Adobe RGB": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290),
    "Display P3": (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.3290),
    "Rec. 2020": (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "ACEScg": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767),
    "ACES2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
}
# Coordinates are written with three digits or more.
_NEAR = 2e-3
_PNG_START = 8
# Chunks before the pixels; there are a dozen kinds.
_MOST_CHUNKS = 64


def unlike_srgb(primaries: Sequence[float]) -> str:
    """What primaries are called; empty where they are sRGB's.

    Args:
        primaries: x and y of red, green, blue and white.
    """
    if _near(primaries, _SRGB):
        return ""
    name = next((name for name, known in _KNOWN.items() if _near(primaries, known)), None)
    pairs = (f"({x:.3g}, {y:.3g})" for x, y in zip(primaries[::2], primaries[1::2], strict=True))
    return f"primaries of {name}" if name else f"primaries and white at {', '.join(pairs)}"


def png_primaries(path: Path) -> tuple[float, ...] | None:
    """The primaries that a PNG states and nothing in it overrides; None where it states none."""
    found = None
    with path.open("rb") as file:
        file.seek(_PNG_START)
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            kind = head[4:]
            if len(head) < 8 or kind in (b"IDAT", b"iCCP", b"sRGB", b"cICP"):
                return found if kind == b"IDAT" else None
            length = int.from_bytes(head[:4], "big")
            content = file.read(32) if kind == b"cHRM" and length == 32 else b""
            if len(content) == 32:
                red, green, blue, white = (content[k : k + 8] for k in (8, 16, 24, 0))
                numbers = struct.unpack(">8I", red + green + blue + white)
                found = tuple(number / 1e5 for number in numbers)
            file.seek(length - len(content) + 4, 1)
    return found


def _near(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(a - b) <= _NEAR for a, b in zip(one, other, strict=True))
