"""Maps of a hemisphere of directions: whence a target was seen, and what detail nobody sees.

Opposite directions count as one, so that a hemisphere holds all of them. The map keeps areas
(Lambert 1772), so that a share of the map is a share of the directions; up is in its middle, the
horizon is its edge.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import ShapeError
from rift_cl.report.plot.camera_plot import axis_names, upright_frame
from rift_cl.report.plot.figure import (
    COLORS,
    INK,
    LINE,
    POINTS,
    SOFT,
    add_panel,
    new_figure,
    real_values,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
# Samples across the map.
_SAMPLES = 121
_SYMBOLS = ("o", "^", "s", "D")
_HOLE = "#f3d5c0"


def direction_maps(
    views: Mapping[str, ArrayLike],
    seen: Callable[[Floats], ArrayLike],
    missing: Callable[[Floats], ArrayLike],
    *,
    up: ArrayLike,
    label: str,
) -> Figure:
    """Two hemispheres: lines of sight, and how often detail along each direction is seen.

    Args:
        views: (n, 3) directions from the target to the cameras, by the name of their group.
        seen: gives the number of views (n,) that see detail along unit vectors (n, 3).
        missing: gives which of them (n,) count as seen by none, and are shaded.
        up: (3,) direction in the middle of the map.
        label: what ``seen`` counts, for the scale.

    Raises:
        ShapeError: there is no group, or an array has other axes.
        DTypeError: a direction is not of real numbers.
        NonFiniteError: a direction, or a number of views, is NaN or infinite.
    """
    if not views:
        raise ShapeError("direction_maps: views is empty, wanted lines of sight")
    frame = upright_frame(up)
    figure = new_figure(1024, 470)
    left, right = (add_panel(figure, x, 40, 430, 420) for x in (10, 470))
    for number, (name, directions) in enumerate(views.items()):
        places = flattened(real_values(f"views of {name}", directions, axes=2) @ frame.T)
        size = float(np.clip(80 / np.sqrt(len(places)), 2, 5))
        color, symbol = COLORS[number % len(COLORS)], _SYMBOLS[number % len(_SYMBOLS)]
        left.plot(*places.T, symbol, color=color, markersize=size, markeredgewidth=0, label=name)
    if len(views) > 1:
        left.legend(fontsize=POINTS - 1, frameon=False, loc="upper left", bbox_to_anchor=(-0.1, 1))
    _draw_seen(figure, right, seen, missing, frame, label)
    for axes, title in ((left, "Lines of sight"), (right, "Directions of detail")):
        _rim(axes, frame, title)
    return figure


def flattened(directions: Floats) -> Floats:
    """Unit vectors (n, 3) as places (n, 2) on the map, in a disc of radius 1.

    A direction below the horizon is shown as its opposite.
    """
    turned = np.where(directions[:, 2:] < 0, -directions, directions)
    return np.asarray(turned[:, :2] / np.sqrt(1 + turned[:, 2:]))


def unflattened(places: Floats) -> Floats:
    """The unit vectors (n, 3) of the upper hemisphere at places (n, 2) of the map."""
    square = (places**2).sum(axis=1, keepdims=True)
    return np.concatenate([places * np.sqrt(2 - square), 1 - square], axis=1)


def _draw_seen(
    figure: Figure,
    axes: Axes,
    seen: Callable[[Floats], ArrayLike],
    missing: Callable[[Floats], ArrayLike],
    frame: Floats,
    label: str,
) -> None:
    along = np.linspace(-1, 1, _SAMPLES)
    x, y = np.meshgrid(along, along)
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    inside = (places**2).sum(axis=1) <= 1
    ways = unflattened(places[inside]) @ frame
    found, hole = np.full(len(places), np.nan), np.zeros(len(places))
    found[inside] = real_values("seen", seen(ways))
    hole[inside] = real_values("missing", missing(ways))
    square, extent = (_SAMPLES, _SAMPLES), (-1, 1, -1, 1)
    shown = axes.imshow(
        found.reshape(square), extent=extent, origin="lower", cmap="viridis_r", vmin=0
    )
    if hole.any():
        axes.contourf(
            x, y, hole.reshape(square), levels=[0.5, 1.5], colors=[_HOLE], hatches=["///"]
        )
    bar = figure.colorbar(shown, cax=add_panel(figure, 925, 90, 14, 300))
    bar.set_label(label, fontsize=POINTS, color=INK)
    bar.ax.tick_params(labelsize=POINTS - 1, labelcolor=SOFT, color=LINE)
    bar.outline.set_visible(False)


def _rim(axes: Axes, frame: Floats, title: str) -> None:
    """The horizon, circles of 30 and 60 degrees of elevation, and the names of the axes."""
    from matplotlib.patches import Circle

    for elevation in (0, 30, 60):
        radius = np.sqrt(1 - np.sin(np.radians(elevation)))
        dash = "-" if elevation == 0 else (0, (2, 3))
        axes.add_patch(
            Circle((0, 0), radius, fill=False, edgecolor=SOFT, linewidth=0.6, linestyle=dash)
        )
        if elevation:
            axes.text(0, -radius, f"{elevation}°", fontsize=POINTS - 2, color=SOFT, ha="center")
    first, second, _ = axis_names(frame)
    style = {"fontsize": POINTS, "color": SOFT}
    axes.text(1.04, 0, first, style, va="center")
    axes.text(0, 1.04, second, style, ha="center")
    axes.set(xlim=(-1.15, 1.25), ylim=(-1.1, 1.2), aspect="equal")
    axes.set_title(title, {"fontsize": POINTS + 1}, color=INK)
    axes.set_axis_off()
