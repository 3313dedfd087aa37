"""Families of curves, each named where it ends."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError, ShapeError
from rift_cl.report.plot.figure import (
    COLORS,
    INK,
    LINE,
    POINTS,
    SOFT,
    WIDE,
    new_figure,
    real_values,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DASHES = ("-", "--", ":", "-.")


def curves(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    xlabel: str,
    ylabel: str,
    log_x: bool = False,
    log_y: bool = False,
    title: str = "",
    mark: float | None = None,
    width: int = WIDE,
) -> Figure:
    """Curves over one pair of axes, each named at its right end in its own colour.

    Args:
        series: (x, y) of every curve under its name, both (n,).
        xlabel: quantity and unit along x.
        ylabel: quantity and unit along y.
        log_x: whether x is logarithmic.
        log_y: whether y is.
        title: a text above the axes.
        mark: a position along x that is shown by a dashed line and its value.
        width: of the figure in pixels; letters keep their size.

    Raises:
        ShapeError: there is no curve, or x and y of one are not (n,) with one n of 1 or more.
        DTypeError: a curve is not of real numbers.
        NonFiniteError: a curve holds NaN or infinity.
        InputError: ``log_x`` is true and an x or ``mark`` is not positive, or so is a y.
    """
    lines = [
        (real_values(f"x of {n}", x), real_values(f"y of {n}", y)) for n, (x, y) in series.items()
    ]
    if not lines or any(x.shape != y.shape for x, y in lines):
        found = {name: (np.size(x), np.size(y)) for name, (x, y) in series.items()}
        raise ShapeError(f"curves: series has sizes {found}, wanted curves with as many x as y")
    marked = [] if mark is None else [mark]
    _check_scale("x", log_x, min([float(x.min()) for x, _ in lines] + marked))
    _check_scale("y", log_y, min(float(y.min()) for _, y in lines))
    figure = new_figure(width, round(width * (0.5625 if width >= WIDE else 0.75)))
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.1)
    axes = figure.add_subplot(xscale=_scale(log_x), yscale=_scale(log_y))
    for k, (x, y) in enumerate(lines):
        dash, dots = _DASHES[k // len(COLORS) % len(_DASHES)], "o" if len(x) <= 16 else ""
        color = COLORS[k % len(COLORS)]
        axes.plot(x, y, dash, color=color, linewidth=1.4, marker=dots, markersize=3)
    if mark is not None:
        axes.axvline(mark, color=SOFT, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        above = axes.get_xaxis_transform()
        axes.text(mark, 1.02, f"{mark:g}", transform=above, ha="center", fontsize=POINTS)
    _style(axes, xlabel, ylabel, title)
    _name_curves(axes, list(series))
    return figure


def _check_scale(axis: str, log: bool, least: float) -> None:
    if log and least <= 0:
        raise InputError(
            f"curves: {axis} goes down to {least:g}, but log_{axis} needs positive numbers"
        )


def _scale(log: bool) -> str:
    return "log" if log else "linear"


def _style(axes: Axes, xlabel: str, ylabel: str, title: str) -> None:
    axes.set_xlabel(xlabel, fontsize=POINTS, color=INK)
    axes.set_ylabel(ylabel, fontsize=POINTS, color=INK)
    axes.set_title(title, {"fontsize": POINTS + 1, "parse_math": False}, "left", 16, color=INK)
    axes.tick_params(which="both", labelsize=POINTS, labelcolor=SOFT, color=LINE, width=0.6)
    axes.grid(axis="y", color=LINE, linewidth=0.5, alpha=0.6)
    axes.spines[:].set(color=LINE, linewidth=0.6)
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
        style = {"color": axes.lines[k].get_color(), "fontsize": POINTS, "va": "center"}
        axes.text(1.015, height[k], names[k], style, transform=axes.transAxes, parse_math=False)
