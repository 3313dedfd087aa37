"""Where cameras stand: the scene from above and from the side, without perspective."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import ShapeError
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

    from rift_cl.geometry import Camera

# Symbols, so that groups are told apart without colour.
_SYMBOLS = ("o", "^", "s", "D", "v", "P", "X")
# A line of sight is drawn so far towards what the camera looks at, as a share of the distance.
_SIGHT = 0.16
# Pixels: width of a panel, and room left of it.
_WIDE, _LEFT = 400, 98


class Stands(NamedTuple):
    """Places of cameras, and which way they look.

    Args:
        places: (n, 3) in world coordinates.
        forward: (n, 3) unit vectors along the optical axes.
    """

    places: ArrayLike
    forward: ArrayLike

    @classmethod
    def of(cls, cameras: Sequence[Camera]) -> Stands:
        """The places and directions of cameras, of which there is one at least."""
        return cls(
            np.array([camera.center for camera in cameras]),
            np.array([camera.view[2, :3] for camera in cameras]),
        )


def camera_plot(
    groups: Mapping[str, Stands],
    *,
    center: Sequence[float],
    diameter: float,
    up: Sequence[float],
    unit: str,
) -> Figure:
    """Cameras round a target, seen from above and from the side.

    Args:
        groups: cameras by the name of their group.
        center: (3,) of the target.
        diameter: of the target, drawn as a disc.
        up: (3,) unit vector.
        unit: of length.

    Raises:
        ShapeError: there is no camera.
        DTypeError: a coordinate is no real number.
        NonFiniteError: a coordinate is NaN or infinite.
    """
    middle = real_values("center", center)
    frame = upright_frame(up)
    drawn = {
        name: (
            (real_values(f"places of {name}", stands.places, axes=2) - middle) @ frame.T,
            real_values(f"forward of {name}", stands.forward, axes=2) @ frame.T,
        )
        for name, stands in groups.items()
    }
    if not drawn:
        raise ShapeError("camera_plot: groups is empty, wanted cameras")
    figure = new_figure(1024, 530)
    above, beside = (add_panel(figure, left, 34, _WIDE, 400) for left in (_LEFT, _LEFT + 512))
    names = axis_names(frame)
    for axes, (across, along), title in (
        (above, (0, 1), "from above"),
        (beside, (0, 2), "from the side"),
    ):
        _draw(axes, drawn, diameter, (across, along))
        _style(axes, f"{names[across]}, {unit}", f"{names[along]}, {unit}", title)
    if len(drawn) > 1:
        handles, labels = above.get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=4, fontsize=POINTS, frameon=False)
    return figure


def upright_frame(up: ArrayLike) -> NDArray[np.float64]:
    """Rows: two horizontal unit vectors and up, right-handed; the world's axes where up is z.

    The first is where a plan's azimuth is zero: x, or y where x is up.
    """
    rise = real_values("up", up)
    rise = rise / np.linalg.norm(rise)
    first = np.eye(3)[0] if abs(rise[0]) < 0.9 else np.eye(3)[1]
    first = first - (first @ rise) * rise
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(rise, first), rise])


def axis_names(frame: NDArray[np.float64]) -> tuple[str, str, str]:
    """x, y and z for axes that are the world's, else what they are."""
    words = ("right", "ahead", "up")
    return tuple(  # type: ignore[return-value]
        "xyz"[axis] if np.allclose(frame[axis], np.eye(3)[axis], atol=1e-6) else words[axis]
        for axis in range(3)
    )


def _draw(
    axes: Axes,
    drawn: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
    diameter: float,
    shown: tuple[int, int],
) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    axes.add_patch(Circle((0, 0), diameter / 2, facecolor=LINE, edgecolor=SOFT, linewidth=0.6))
    for number, (name, (places, forward)) in enumerate(drawn.items()):
        color = COLORS[number % len(COLORS)]
        distance = np.linalg.norm(places, axis=1, keepdims=True)
        ends = places + _SIGHT * distance * forward
        lines = np.stack([places, ends], axis=1)[:, :, list(shown)]
        axes.add_collection(LineCollection(list(lines), colors=color, linewidths=0.5, alpha=0.6))
        axes.plot(
            *places[:, list(shown)].T,
            _SYMBOLS[number % len(_SYMBOLS)],
            color=color,
            markersize=float(np.clip(60 / np.sqrt(len(places)), 2, 5)),
            markeredgewidth=0,
            label=name,
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)


def _style(axes: Axes, across: str, along: str, title: str) -> None:
    axes.set_xlabel(across, fontsize=POINTS, color=INK)
    axes.set_ylabel(along, fontsize=POINTS, color=INK)
    # Clear of the longest numbers, whatever they are here.
    axes.yaxis.set_label_coords(-(_LEFT - 26) / _WIDE, 0.5)
    axes.set_title(title, {"fontsize": POINTS + 1, "parse_math": False}, color=INK)
    axes.tick_params(labelsize=POINTS - 1, labelcolor=SOFT, color=LINE, width=0.6)
    axes.grid(color=LINE, linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)
    axes.spines[:].set(color=LINE, linewidth=0.6)
