"""Planes of the space of frequencies: how often views saw each; the paper's Figures 4 and 7.

The scale is logarithmic, since density falls by orders of magnitude from the middle outwards; what
hardly any view saw is left white, so that a missing cone stands out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from rift_cl.errors import InputError, ShapeError
from rift_cl.report.plot.figure import INK, LINE, POINTS, SOFT, add_panel, new_figure, real_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

# Perceptually even, rising in lightness, and readable without colour.
_MAP, _NOTHING = "viridis_r", "#ffffff"
# Pixels: edge of a panel, room left of and below it, of a title, and of the scale on the right.
_EDGE, _LEFT, _BELOW, _ABOVE, _SCALE = 236, 104, 62, 34, 134


@dataclass(frozen=True, eq=False)
class FrequencySlice:
    """One plane of the space of frequencies.

    Args:
        values: (n, n) density, row 0 at the lowest frequency of ``axes[1]``.
        extent: the highest frequency along both axes; the lowest is its negative.
        axes: names of what runs to the right and upwards, such as kx and kz.
        title: a text above the panel.
    """

    values: ArrayLike
    extent: float
    axes: tuple[str, str]
    title: str


def frequency_maps(
    slices: Sequence[FrequencySlice],
    *,
    columns: int,
    window: tuple[float, float],
    label: str,
    unit: str,
) -> Figure:
    """Maps of density over planes of frequencies, in one logarithmic scale.

    Args:
        slices: row by row.
        columns: panels in a row.
        window: densities at the ends of the scale, both positive; below it a panel is white.
        label: what the density is, for the scale.
        unit: of length, of which frequencies are cycles per.

    Raises:
        ShapeError: there is no slice, or one has other axes.
        DTypeError: a slice is not of real numbers.
        NonFiniteError: a slice holds NaN or infinity.
        InputError: the window or ``columns`` makes no sense.
    """
    low, high = window
    if not slices or columns < 1:
        raise ShapeError(f"frequency_maps: {len(slices)} slices, {columns} columns, wanted some")
    if not 0 < low < high:
        raise InputError(f"frequency_maps: window is {window!r}, wanted two rising positive ones")
    rows = -(-len(slices) // columns)
    across, down = _LEFT + _EDGE, _ABOVE + _EDGE + _BELOW
    wide = min(columns, len(slices)) * across
    figure = new_figure(wide + _SCALE, rows * down)
    for place, part in enumerate(slices):
        row, column = divmod(place, columns)
        axes = add_panel(figure, column * across + _LEFT, row * down + _ABOVE, _EDGE, _EDGE)
        shown = _draw(axes, part, window, unit)
    scale = add_panel(figure, wide + 24, _ABOVE, 16, rows * down - _ABOVE - _BELOW)
    bar = figure.colorbar(shown, cax=scale, extend="min")
    bar.set_label(label, fontsize=POINTS, color=INK)
    bar.ax.tick_params(labelsize=POINTS - 1, labelcolor=SOFT, color=LINE)
    bar.outline.set_visible(False)
    return figure


def _draw(axes: Axes, part: FrequencySlice, window: tuple[float, float], unit: str) -> AxesImage:
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    values = real_values(f"values of {part.title!r}", part.values, axes=2)
    colors = colormaps[_MAP].with_extremes(under=_NOTHING)
    edge = part.extent
    low, high = window
    shown = axes.imshow(
        values.clip(low / 2),
        cmap=colors,
        norm=LogNorm(low, high),
        extent=(-edge, edge, -edge, edge),
        origin="lower",
        interpolation="antialiased",
    )
    across, up = part.axes
    axes.set_xlabel(f"{across}, cycles per {unit}", fontsize=POINTS, color=INK, labelpad=2)
    axes.set_ylabel(f"{up}, cycles per {unit}", fontsize=POINTS, color=INK, labelpad=2)
    # Clear of the longest numbers, whatever they are here.
    axes.yaxis.set_label_coords(-(_LEFT - 26) / _EDGE, 0.5)
    axes.set_title(part.title, {"fontsize": POINTS, "parse_math": False}, color=INK, pad=5)
    axes.tick_params(labelsize=POINTS - 1, labelcolor=SOFT, color=LINE, width=0.6)
    axes.locator_params(nbins=5)
    axes.spines[:].set(color=LINE, linewidth=0.6)
    return shown
