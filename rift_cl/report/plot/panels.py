"""Panels of images, laid out in whole pixels and enlarged by whole factors: samples are squares."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.report.plot.figure import (
    DPI,
    INK,
    POINTS,
    SOFT,
    drawable,
    new_figure,
    real_values,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Pixels between panels, of a line's height, of a letter's width.
_GAP, _ROW, _LETTER = 16, 26, 10
_Window = tuple[float, float]


class _Panel(NamedTuple):
    codes: NDArray[np.uint8]  # (y, x, 3)
    title: str
    high: int
    wide: int


def image_grid(
    images: Sequence[ArrayLike],
    *,
    titles: Sequence[str],
    columns: int,
    window: _Window | Sequence[_Window] | None = None,
    row_labels: Sequence[str] | None = None,
    size: float = 2.4,
    unit: str = "",
) -> Figure:
    """Panels side by side, with the display window of grey ones stated below them.

    Args:
        images: the panels row by row, each (y, x), or (y, x, 3) colours from 0 to 1, which are
            shown as they are; row 0 of an image is on top.
        titles: a text above each panel, empty where none is wanted; it may hold line breaks.
        columns: panels in a row.
        window: (black, white) for all panels, or one such pair for each row. When not given, from
            the darkest to the brightest sample of all images.
        row_labels: a text left of each row.
        size: longer side of a panel in inches, up to the rounding that keeps samples square.
        unit: of grey samples, such as per mm; stated with their window.

    Raises:
        ShapeError: no image, one of other axes, or titles, labels or windows do not match.
        DTypeError: an image is not of real numbers.
        NonFiniteError: an image holds NaN or infinity.
        InputError: white is not above black, or ``columns`` or ``size`` is not positive.
    """
    pixels = [
        drawable(f"images[{k}]", image, axes=3 if np.shape(image)[2:] == (3,) else 2)
        for k, image in enumerate(images)
    ]
    if columns < 1 or not 0 < size < math.inf:
        raise InputError(f"image_grid: columns is {columns}, size {size}; wanted positive numbers")
    rows = -(-len(pixels) // columns)
    labels = [""] * rows if row_labels is None else list(row_labels)
    if not pixels or len(titles) != len(pixels) or len(labels) != rows:
        raise ShapeError(
            f"image_grid: {len(pixels)} images in {rows} rows came with {len(titles)} titles and "
            f"{len(labels)} row labels, wanted images, a title for each and a label for each row"
        )
    windows = _windows(pixels, window, rows)
    stated = [f"{a:.3g} to {b:.3g}".replace("-", "\N{MINUS SIGN}") for a, b in windows]
    footer = stated[0] if len(set(stated)) == 1 else "by row: " + "; ".join(stated)
    footer = f"Display window {footer} {unit}".rstrip()
    grey = any(image.ndim == 2 for image in pixels)
    panels = []
    for k, (image, title) in enumerate(zip(pixels, titles, strict=True)):
        high, wide = _drawn_size(image, round(size * DPI))
        codes = _codes(_drawn(image, high, wide), windows[k // columns])
        panels.append(_Panel(codes, _wrapped(title, wide), high, wide))
    return _draw_grid(panels, columns, labels, footer if grey else "")


def _codes(image: NDArray[Any], window: _Window) -> NDArray[np.uint8]:
    """Grey or colours from 0 to 255; Matplotlib would take a dozen copies of numbers for them."""
    low, high = window if image.ndim == 2 else (0.0, 1.0)
    codes = np.rint(np.clip((image - low) / (high - low), 0, 1) * 255).astype(np.uint8)
    return codes if image.ndim == 3 else np.repeat(codes[..., None], 3, axis=2)


def _drawn(image: NDArray[Any], high: int, wide: int) -> NDArray[Any]:
    """The samples that are drawn: means of those that share a pixel.

    They are taken before anything is made of the image, a slice of which may be most of the memory.
    """
    from PIL import Image

    if high < image.shape[0] or wide < image.shape[1]:
        channels = np.moveaxis(np.atleast_3d(image), 2, 0)
        means = [
            np.asarray(
                Image.fromarray(np.asarray(channel, np.float32)).resize(
                    (wide, high), Image.Resampling.BOX
                )
            )
            for channel in channels
        ]
        image = means[0] if image.ndim == 2 else np.stack(means, axis=2)
    return image


def _windows(
    images: Sequence[NDArray[Any]], window: _Window | Sequence[_Window] | None, rows: int
) -> list[_Window]:
    if window is None:
        low, high = min(p.min() for p in images), max(p.max() for p in images)
        window = (float(low), float(high) if high > low else float(low) + 1)
    pairs = real_values("window", window, axes=np.ndim(window))
    if pairs.shape not in ((2,), (rows, 2)):
        raise ShapeError(f"image_grid: window has shape {pairs.shape}, wanted (2,) or ({rows}, 2)")
    if not (pairs[..., 1] > pairs[..., 0]).all():
        raise InputError(f"image_grid: window is {window!r}, white must be above black")
    return [(float(low), float(high)) for low, high in np.broadcast_to(pairs, (rows, 2))]


def _drawn_size(image: NDArray[Any], target: int) -> tuple[int, int]:
    factor = target / max(image.shape[:2])
    factor = max(1, round(factor)) if factor > 0.75 else factor
    return max(1, round(image.shape[0] * factor)), max(1, round(image.shape[1] * factor))


def _wrapped(text: str, pixels: int) -> str:
    return "\n".join(textwrap.fill(t, max(8, pixels // _LETTER)) for t in text.split("\n"))


def _height(texts: Sequence[str]) -> int:
    return max((text.count("\n") + 1) * _ROW if text else 0 for text in texts)


def _draw_grid(
    panels: Sequence[_Panel], columns: int, labels: Sequence[str], footer: str
) -> Figure:
    high, wide = max(p.high for p in panels), max(p.wide for p in panels)
    labels = [_wrapped(label, high) for label in labels]
    left, below, tops = _GAP + _height(labels), _GAP, []
    for first in range(0, len(panels), columns):
        tops.append(below + _height([p.title for p in panels[first : first + columns]]))
        below = tops[-1] + high + _GAP
    across = max(420, left + min(columns, len(panels)) * (wide + _GAP))
    footer = _wrapped(footer, across - left)
    figure = new_figure(across, below + _height([footer]))
    for k, panel in enumerate(panels):
        x, y = left + k % columns * (wide + _GAP), tops[k // columns]
        _write(figure, (x + wide / 2, y - 7), panel.title, va="bottom", ha="center")
        _draw_panel(figure, panel, x + (wide - panel.wide) // 2, y + (high - panel.high) // 2)
    for top, label in zip(tops, labels, strict=True):
        _write(figure, (left - 8, top + high / 2), label, va="center", ha="right", rotation=90)
    _write(figure, (left, below - 6), footer, va="top", ha="left", color=SOFT)
    return figure


def _draw_panel(figure: Figure, panel: _Panel, x: int, y: int) -> None:
    from rift_cl.report.plot.pixels import Pixels

    height, width = panel.codes.shape[:2]
    codes = panel.codes.repeat(panel.high // height, 0).repeat(panel.wide // width, 1)
    _, below = figure.get_size_inches() * DPI
    figure.images.append(Pixels(figure, codes, x, round(below) - y - panel.high))


def _write(figure: Figure, at: tuple[float, float], text: str, **style: Any) -> None:
    width, height = figure.get_size_inches() * DPI
    style = {"color": INK, "fontsize": POINTS, "parse_math": False, **style}
    figure.text(at[0] / width, 1 - at[1] / height, text, **style)
