"""Images inside JSON: eight bits a sample within a display window, compressed, as text."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray


def encode(image: NDArray[np.float32], window: tuple[float, float]) -> dict[str, Any]:
    """An image, (y, x) or (y, x, 3), as JSON; values outside the window are clipped to it."""
    low, high = window
    codes = np.rint(255 * np.clip((image - low) / (high - low), 0, 1)).astype(np.uint8)
    text = base64.b64encode(zlib.compress(codes.tobytes(), 9)).decode("ascii")
    return {"shape": list(image.shape), "window": list(window), "zlib": text}


def decode(packed: dict[str, Any]) -> NDArray[np.float32]:
    """The image that ``encode`` packed, to the precision of its eight bits."""
    low, high = packed["window"]
    data = zlib.decompress(base64.b64decode(packed["zlib"]))
    codes = np.frombuffer(data, np.uint8).reshape(packed["shape"])
    return (low + (high - low) * codes.astype(np.float32) / 255).astype(np.float32)
