"""Nine modes side by side: their amplitude in two colours for its sign, and their intensity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.images import decode, encode
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png, image_grid

Floats = NDArray[np.float64]
# Negative and positive amplitudes, of Okabe and Ito's palette.
_NEGATIVE, _POSITIVE = np.array([0.0, 0.447, 0.698]), np.array([0.835, 0.369, 0.0])


def signed_colors(values: Floats) -> Floats:
    """Numbers from -1 to 1 as colours (..., 3): white at zero."""
    amount = np.clip(np.abs(values), 0, 1)[..., None]
    ends = np.where(values[..., None] < 0, _NEGATIVE, _POSITIVE)
    return np.asarray(1 - amount * (1 - ends))


def packed(modes: Floats, names: Sequence[str]) -> list[dict[str, Any]]:
    """Pictures (K, y, x), each over its largest magnitude, with their names; JSON."""
    largest = np.abs(modes).max(axis=(1, 2), keepdims=True)
    return [
        {"name": name, "image": encode(mode.astype(np.float32), (-1.0, 1.0))}
        for name, mode in zip(names, modes / largest, strict=True)
    ]


def show_gallery(page: Page, modes: Sequence[dict[str, Any]], what: str, columns: int = 3) -> None:
    """Draw amplitudes, then intensities."""
    names = [mode["name"] for mode in modes]
    values = [decode(mode["image"]).astype(np.float64) for mode in modes]
    for title, pictures in (
        ("Amplitude, positive in orange and negative in blue", [signed_colors(v) for v in values]),
        ("Intensity", [v**2 for v in values]),
    ):
        figure = image_grid(pictures, titles=names, columns=columns, size=1.2)
        page.figure(
            figure_png(figure),
            caption=f"{title}; each mode over its own peak. {what}",
            alt=f"{title} of {', '.join(names)}",
        )
