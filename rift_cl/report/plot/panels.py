"""Panels of images, laid out in whole pixels and enlarged by whole factors: samples are squares."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError, ShapeError
from rift_cl.report.plot.figure import (
    DPI,
    INK,
    POINTS,
    SOFT,
    Reals,
    add_panel,
    new_figure,
    real_values,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Pixels between panels, of a line's height, of a letter's width.
_GAP, _ROW, _LETTER = 16, 26, 10
_Window = tuple[float, float]


class _Panel(NamedTuple):
    image: Reals
    title: str
    window: _Window
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
    pixels = [_pixels(f"images[{k}]", image) for k, image in enumerate(images)]
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
        panels.append(_Panel(image, _wrapped(title, wide), windows[k // columns], high, wide))
    return _draw_grid(panels, columns, labels, footer if grey else "")


def _pixels(name: str, image: ArrayLike) -> Reals:
    if np.shape(image)[2:] == (3,):
        return np.clip(real_values(name, image, axes=3), 0, 1)
    return real_values(name, image, axes=2)


def _windows(
    images: Sequence[Reals], window: _Window | Sequence[_Window] | None, rows: int
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


def _drawn_size(image: Reals, target: int) -> tuple[int, int]:
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
    axes = add_panel(figure, x, y, panel.wide, panel.high)
    axes.set_axis_off()
    look = "nearest" if panel.high >= panel.image.shape[0] else "antialiased"
    low, high = panel.window
    axes.imshow(panel.image, cmap="gray", vmin=low, vmax=high, aspect="auto", interpolation=look)


def _write(figure: Figure, at: tuple[float, float], text: str, **style: Any) -> None:
    width, height = figure.get_size_inches() * DPI
    style = {"color": INK, "fontsize": POINTS, "parse_math": False, **style}
    figure.text(at[0] / width, 1 - at[1] / height, text, **style)
