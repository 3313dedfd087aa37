"""Display light and linear light: the curve of sRGB (IEC 61966-2-1), both ways, in place.

Light adds up and display codes do not, so that pixels are averaged in linear light alone. A block
at a time keeps the temporaries in the cache.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

# The light that colours are in.
LightKind = Literal["display", "linear"]
Light = NDArray[np.float32]

_BLOCK = 1 << 15


def to_linear(values: Light) -> None:
    """Turn display light into linear light; any real number, the curve goes on beyond 1."""
    for block in _blocks(values):
        curved = block > np.float32(0.04045)
        power = ((np.maximum(block, 0) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
        block[...] = np.where(curved, power, block / np.float32(12.92))


def to_display(values: Light) -> None:
    """Turn linear light into display light; the inverse of ``to_linear``."""
    for block in _blocks(values):
        curved = block > np.float32(0.0031308)
        power = np.float32(1.055) * np.maximum(block, 0) ** np.float32(1 / 2.4) - np.float32(0.055)
        block[...] = np.where(curved, power, block * np.float32(12.92))


def _blocks(values: Light) -> Iterator[Light]:
    rows = max(1, _BLOCK // max(1, values[0].size))
    for start in range(0, len(values), rows):
        yield values[start : start + rows]
