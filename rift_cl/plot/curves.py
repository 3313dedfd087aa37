"""Families of curves, each named where it ends."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError, ShapeError
from rift_cl.plot.figure import INK, LINE, POINTS, SOFT, new_figure, real_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart by colour-blind readers; its yellow is too pale for lines.
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", INK)
_DASHES = ("-", "--", ":", "-.")


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
    lines = [
        (real_values(f"x of {n}", x), real_values(f"y of {n}", y)) for n, (x, y) in series.items()
    ]
    if not lines or any(x.shape != y.shape for x, y in lines):
        found = {name: (np.size(x), np.size(y)) for name, (x, y) in series.items()}
        raise ShapeError(f"curves: series has sizes {found}, wanted curves with as many x as y")
    least = min([float(x.min()) for x, _ in lines] + ([] if mark is None else [mark]))
    if log_x and least <= 0:
        raise InputError(f"curves: x goes down to {least:g}, but log_x needs positive numbers")
    figure = new_figure(1024, 576)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.1)
    axes = figure.add_subplot(xscale="log" if log_x else "linear")
    for k, (x, y) in enumerate(lines):
        dash, dots = _DASHES[k // len(_COLORS) % len(_DASHES)], "o" if len(x) <= 16 else ""
        color = _COLORS[k % len(_COLORS)]
        axes.plot(x, y, dash, color=color, linewidth=1.4, marker=dots, markersize=3)
    if mark is not None:
        axes.axvline(mark, color=SOFT, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        above = axes.get_xaxis_transform()
        axes.text(mark, 1.02, f"{mark:g}", transform=above, ha="center", fontsize=POINTS)
    _style(axes, xlabel, ylabel, title)
    _name_curves(axes, list(series))
    return figure


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
