"""An image or a volume as a notebook shows it: ``rift.show(volume)``.

A volume is a strip of slices, one of which is seen at a time; it goes on by the slider below, by
swiping, or by the arrow keys, and where a notebook runs no script the strip can still be scrolled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.host_arrays import as_real_array, is_device_array
from rift_cl.errors import NonFiniteError, ShapeError
from rift_cl.report.html_page.pictures import data_address
from rift_cl.report.html_page.text import escape
from rift_cl.report.plot import framed

# Slices that a strip holds, pixels across it, and bytes of all its pictures.
_FRAMES, _WIDTH, _BUDGET = 32, 420, 1 << 20
# Percentiles of the values that are shown black and white, in percent.
_WINDOW = (0.5, 99.5)
# A picture of fewer samples across is enlarged to squares.
_COARSE = 256


@dataclass(frozen=True, eq=False)
class Shown:
    """Pictures for a notebook.

    Args:
        files: the content of a JPEG file each.
        labels: a text for each.
        size: (height, width) of each, in pixels.
        alt: what they show, for who does not see them.
    """

    files: tuple[bytes, ...]
    labels: tuple[str, ...]
    size: tuple[int, int]
    alt: str

    def __repr__(self) -> str:
        """What a terminal shows."""
        return f"<{self.alt}: {len(self.files)} picture{'s' if len(self.files) > 1 else ''}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        width = min(_WIDTH, max(self.size[1], _WIDTH // 2))
        coarse = "image-rendering:pixelated;" if max(self.size) < _COARSE else ""
        style = f"flex:none;width:100%;{coarse}scroll-snap-align:start;margin:0"
        frames = "".join(
            f"<figure style='{style}'><img src='{data_address(file)}' "
            f"alt='{escape(f'{self.alt}, {label}')}' style='width:100%;{coarse}'>"
            f"<figcaption>{escape(label)}</figcaption></figure>"
            for file, label in zip(self.files, self.labels, strict=True)
        )
        strip = (
            f"<div tabindex='0' role='group' aria-label='{escape(self.alt)}' "
            "style='display:flex;overflow-x:auto;scroll-snap-type:x mandatory'>"
            f"{frames}</div>"
        )
        slider = (
            f"<input type='range' min='0' max='{len(self.files) - 1}' value='0' "
            f"aria-label='Slice of {escape(self.alt)}' style='width:100%' "
            "oninput='const s=this.previousElementSibling;s.scrollLeft=this.value*s.clientWidth'>"
            if len(self.files) > 1
            else ""
        )
        return f"<div style='max-width:{width}px'>{strip}{slider}</div>"


def show(
    values: Any, *, window: tuple[float, float] | None = None, alt: str | None = None
) -> Shown:
    """An image or a volume for a notebook.

    Args:
        values: an image (y, x), a picture (y, x, 3) of colours from 0 to 1, or a volume (z, y, x),
            of which at most 32 slices are shown; of the host or of a device.
        window: values that are black and white; the percentiles 0.5 and 99.5 if not given, and
            0 and 1 of colours.
        alt: what it shows, in words.

    Raises:
        ShapeError: it is none of these.
        DTypeError: it is not of real numbers.
        NonFiniteError: it holds NaN or infinity.
    """
    array = as_real_array(values.get() if is_device_array(values) else values, name="values")  # type: ignore[attr-defined]
    colors = array.ndim == 3 and array.shape[2] == 3
    if array.ndim not in (2, 3) or array.size == 0:
        raise ShapeError(f"values has shape {array.shape}, wanted (y, x), (y, x, 3) or (z, y, x)")
    volume = array.ndim == 3 and not colors
    numbers = _few(len(array)) if volume else [0]
    images = [array[n] for n in numbers] if volume else [array]
    files, size = framed(images, window=window or _window(images, colors), budget=_BUDGET)
    labels = [f"slice {n + 1} of {len(array)}" for n in numbers] if volume else [_about(array)]
    what = "volume" if volume else "image"
    return Shown(tuple(files), tuple(labels), size, alt or f"{what} {array.shape}")


def _few(count: int) -> list[int]:
    """Numbers of slices, evenly spaced, the first and the last among them."""
    return sorted({round(n) for n in np.linspace(0, count - 1, min(count, _FRAMES)).tolist()})


def _about(image: NDArray[Any]) -> str:
    return f"{image.shape[0]} x {image.shape[1]}, {image.min():.4g} to {image.max():.4g}"


def _window(images: list[NDArray[Any]], colors: bool) -> tuple[float, float]:
    if colors:
        return 0.0, 1.0
    low, high = (float(level) for level in np.percentile(np.stack(images), _WINDOW))
    if not np.isfinite([low, high]).all():
        raise NonFiniteError("values holds NaN or infinity: replace them before they are shown")
    return low, high if high > low else low + 1
