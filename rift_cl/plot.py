"""Figures of reports: panels of images and families of curves, drawn without a display.

Only matplotlib's objects are used, never its global state, so that a program that plots for itself
is not disturbed. Panels are laid out in whole pixels, at 160 dots per inch, and enlarged by whole
factors: every sample is a crisp square.
"""

from __future__ import annotations

import io
import itertools
import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DPI = 160
_INK, _SOFT, _LINE = "#1c1d1f", "#63666b", "#c9ccd0"
# Okabe and Ito's palette, told apart by colour-blind readers; its yellow is too pale for lines.
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", _INK)
_DASHES = ("-", "--", ":", "-.")
_POINTS = 8.5
_GAP, _ROW, _LETTER = 16, 26, 10  # pixels: between panels, height of a line, width of a letter
_Reals = NDArray[np.float64]
_Window = tuple[float, float]


class _Panel(NamedTuple):
    image: _Reals
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
    panels = []
    for k, (image, title) in enumerate(zip(pixels, titles, strict=True)):
        high, wide = _drawn_size(image, round(size * _DPI))
        panels.append(_Panel(image, _wrapped(title, wide), windows[k // columns], high, wide))
    return _draw_grid(panels, columns, labels, f"Display window {footer}")


def _pixels(name: str, image: ArrayLike) -> _Reals:
    if np.shape(image)[2:] == (3,):
        return np.clip(_real(name, image, axes=3), 0, 1)
    return _real(name, image, axes=2)


def _windows(
    images: Sequence[_Reals], window: _Window | Sequence[_Window] | None, rows: int
) -> list[_Window]:
    if window is None:
        low, high = min(p.min() for p in images), max(p.max() for p in images)
        window = (float(low), float(high) if high > low else float(low) + 1)
    pairs = _real("window", window, axes=np.ndim(window))
    if pairs.shape not in ((2,), (rows, 2)):
        raise ShapeError(f"image_grid: window has shape {pairs.shape}, wanted (2,) or ({rows}, 2)")
    if not (pairs[..., 1] > pairs[..., 0]).all():
        raise InputError(f"image_grid: window is {window!r}, white must be above black")
    return [(float(low), float(high)) for low, high in np.broadcast_to(pairs, (rows, 2))]


def _drawn_size(image: _Reals, target: int) -> tuple[int, int]:
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
    figure = _figure(across, below + _height([footer]))
    for k, panel in enumerate(panels):
        x, y = left + k % columns * (wide + _GAP), tops[k // columns]
        _write(figure, (x + wide / 2, y - 7), panel.title, va="bottom", ha="center")
        _draw_panel(figure, panel, x + (wide - panel.wide) // 2, y + (high - panel.high) // 2)
    for top, label in zip(tops, labels, strict=True):
        _write(figure, (left - 8, top + high / 2), label, va="center", ha="right", rotation=90)
    _write(figure, (left, below - 6), footer, va="top", ha="left", color=_SOFT)
    return figure


def _draw_panel(figure: Figure, panel: _Panel, x: int, y: int) -> None:
    width, height = figure.get_size_inches() * _DPI
    bottom = 1 - (y + panel.high) / height
    axes = figure.add_axes((x / width, bottom, panel.wide / width, panel.high / height))
    axes.set_axis_off()
    look = "nearest" if panel.high >= panel.image.shape[0] else "antialiased"
    low, high = panel.window
    axes.imshow(panel.image, cmap="gray", vmin=low, vmax=high, aspect="auto", interpolation=look)


def _write(figure: Figure, at: tuple[float, float], text: str, **style: Any) -> None:
    width, height = figure.get_size_inches() * _DPI
    style = {"color": _INK, "fontsize": _POINTS, "parse_math": False, **style}
    figure.text(at[0] / width, 1 - at[1] / height, text, **style)


def curves(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    xlabel: str,
    ylabel: str,
    log_x: bool = False,
    title: str = "",
    mark: float | None = None,
) -> Figure:
    """Curves over one pair of axes, each named at its right end in its own colour.

    Args:
        series: (x, y) of every curve under its name, both (n,).
        xlabel: quantity and unit along x.
        ylabel: quantity and unit along y.
        log_x: whether x is logarithmic.
        title: a text above the axes.
        mark: a position along x that is shown by a dashed line and its value.

    Raises:
        ShapeError: there is no curve, or x and y of one are not (n,) with one n of 1 or more.
        DTypeError: a curve is not of real numbers.
        NonFiniteError: a curve holds NaN or infinity.
        InputError: ``log_x`` is true and an x or ``mark`` is not positive.
    """
    lines = [(_real(f"x of {n}", x), _real(f"y of {n}", y)) for n, (x, y) in series.items()]
    if not lines or any(x.shape != y.shape for x, y in lines):
        found = {name: (np.size(x), np.size(y)) for name, (x, y) in series.items()}
        raise ShapeError(f"curves: series has sizes {found}, wanted curves with as many x as y")
    least = min([float(x.min()) for x, _ in lines] + ([] if mark is None else [mark]))
    if log_x and least <= 0:
        raise InputError(f"curves: x goes down to {least:g}, but log_x needs positive numbers")
    figure = _figure(1024, 576)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.1)
    axes = figure.add_subplot(xscale="log" if log_x else "linear")
    for k, (x, y) in enumerate(lines):
        dash, dots = _DASHES[k // len(_COLORS) % len(_DASHES)], "o" if len(x) <= 16 else ""
        color = _COLORS[k % len(_COLORS)]
        axes.plot(x, y, dash, color=color, linewidth=1.4, marker=dots, markersize=3)
    if mark is not None:
        axes.axvline(mark, color=_SOFT, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        above = axes.get_xaxis_transform()
        axes.text(mark, 1.02, f"{mark:g}", transform=above, ha="center", fontsize=_POINTS)
    _style(axes, xlabel, ylabel, title)
    _name_curves(axes, list(series))
    return figure


def _style(axes: Axes, xlabel: str, ylabel: str, title: str) -> None:
    axes.set_xlabel(xlabel, fontsize=_POINTS, color=_INK)
    axes.set_ylabel(ylabel, fontsize=_POINTS, color=_INK)
    axes.set_title(title, {"fontsize": _POINTS + 1, "parse_math": False}, "left", 16, color=_INK)
    axes.tick_params(which="both", labelsize=_POINTS, labelcolor=_SOFT, color=_LINE, width=0.6)
    axes.grid(axis="y", color=_LINE, linewidth=0.5, alpha=0.6)
    axes.spines[:].set(color=_LINE, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _name_curves(axes: Axes, names: Sequence[str]) -> None:
    axes.autoscale_view()
    ends = [np.asarray(line.get_data())[:, -1] for line in axes.lines[: len(names)]]
    height = [(axes.transScale + axes.transLimits).transform(end)[1] for end in ends]
    # A name is 0.06 of the axes high. Those that would overlap move up, then all back below 1.
    order = sorted(range(len(names)), key=height.__getitem__)
    for below, above in itertools.pairwise(order):
        height[above] = max(height[above], height[below] + 0.06)
    for rank, k in enumerate(reversed(order)):
        height[k] = min(height[k], 1 - 0.06 * rank)
        style = {"color": axes.lines[k].get_color(), "fontsize": _POINTS, "va": "center"}
        axes.text(1.015, height[k], names[k], style, transform=axes.transAxes, parse_math=False)


def _real(name: str, values: ArrayLike, *, axes: int = 1) -> _Reals:
    array: NDArray[Any] = np.asarray(values)
    if array.dtype.kind not in "biuf":
        raise DTypeError(f"{name} has type {array.dtype}, wanted real numbers")
    if array.ndim != axes or array.size == 0:
        raise ShapeError(f"{name} has shape {array.shape}, wanted {axes} axes and a sample or more")
    if not np.isfinite(array).all():
        raise NonFiniteError(f"{name} holds NaN or infinity; replace such values before plotting")
    return array.astype(np.float64)


def _figure(width: int, height: int) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")


def figure_png(figure: Figure) -> bytes:
    """The figure as the content of a PNG file, the same bytes for the same figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=figure.dpi, metadata={"Software": None})
    return buffer.getvalue()
