"""A section through the target in colours: what varies from place to place, such as what is known.

Lengths are to scale, contours tell the values without colour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError
from rift_cl.report.plot.figure import INK, LINE, POINTS, SOFT, add_panel, new_figure, real_values

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAP = "viridis_r"
# Pixels: the longer edge of the panel, room left of, above and below it, and of the scale.
_EDGE, _LEAST, _LEFT, _ABOVE, _BELOW, _SCALE = 420, 90, 92, 16, 56, 134
_CONTOURS = 5


def section_map(
    values: ArrayLike,
    *,
    edges: tuple[tuple[float, float], tuple[float, float]],
    axes: tuple[str, str],
    label: str,
    unit: str,
) -> Figure:
    """A map of shares over a plane through the target's middle.

    Args:
        values: (rows, columns) from 0 to 1, row 0 at the lowest coordinate of ``axes[1]``.
        edges: coordinates of the map's ends, to the right and upwards.
        axes: names of what runs to the right and upwards, such as x and z.
        label: what the shares are of, for the scale.
        unit: of length.

    Raises:
        ShapeError: the values have other axes.
        DTypeError: they are not real numbers.
        NonFiniteError: one is NaN or infinite.
        InputError: the coordinates do not rise.
    """
    percent = 100 * real_values("values of a section", values, axes=2)
    right, up = (high - low for low, high in edges)
    if not min(right, up) > 0:
        raise InputError(f"section_map: edges is {edges!r}, wanted rising coordinates")
    wide = max(_LEAST, round(_EDGE * min(1, right / up)))
    high = max(_LEAST, round(_EDGE * min(1, up / right)))
    figure = new_figure(_LEFT + wide + _SCALE, _ABOVE + high + _BELOW)
    panel = add_panel(figure, _LEFT, _ABOVE, wide, high)
    extent = (*edges[0], *edges[1])
    most = max(float(percent.max()), 0.1)
    shown = panel.imshow(
        percent, cmap=_MAP, vmin=0, vmax=most, extent=extent, origin="lower", aspect="auto"
    )
    if np.ptp(percent) > 0 and min(percent.shape) > 1:
        levels = np.linspace(0, most, _CONTOURS + 2)[1:-1]
        lines = panel.contour(
            percent, levels, extent=extent, origin="lower", colors=INK, linewidths=0.5
        )
        panel.clabel(lines, fontsize=POINTS - 2, fmt=lambda value: f"{value:.2g} %")
    panel.set_xlabel(f"{axes[0]}, {unit}", fontsize=POINTS, color=INK, labelpad=2)
    panel.set_ylabel(f"{axes[1]}, {unit}", fontsize=POINTS, color=INK, labelpad=2)
    panel.tick_params(labelsize=POINTS - 1, labelcolor=SOFT, color=LINE, width=0.6)
    panel.locator_params(nbins=5)
    panel.spines[:].set(color=LINE, linewidth=0.6)
    scale = add_panel(figure, _LEFT + wide + 24, _ABOVE, 16, high)
    bar = figure.colorbar(shown, cax=scale, format=lambda value, _: f"{value:.3g}")
    bar.set_label(f"{label}, %", fontsize=POINTS, color=INK)
    bar.ax.tick_params(labelsize=POINTS - 1, labelcolor=SOFT, color=LINE)
    bar.outline.set_visible(False)
    return figure
