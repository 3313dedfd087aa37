"""The picture of figure 9: a lens, its principal planes, a stop and a pinhole, to one scale."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rift_cl.report.plot.figure import INK, LINE, POINTS, SOFT, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_GLASS = "#d7e6f1"
_RAYS = ("#0072b2", "#d55e00")
_TITLES = (
    "a  surfaces, stop and sensor: real rays",
    "b  principal planes and pupils",
    "c  a stop",
    "d  a pinhole",
)

Point = tuple[float, float]


def draw(drawing: dict[str, Any]) -> Figure:
    """The four stages below each other, from what ``figure_09`` has computed."""
    figure = new_figure(1536, 900)
    figure.set_layout_engine("constrained", w_pad=0.08, h_pad=0.06)
    panels = figure.subplots(4, 1)
    for axes, title, stage in zip(panels, _TITLES, (_lens, _planes, _stop, _pinhole), strict=True):
        axes.set_title(title, {"fontsize": POINTS + 1}, "left", color=INK)
        _common(axes, drawing)
        stage(axes, drawing)
    return figure


def _common(axes: Axes, drawing: dict[str, Any]) -> None:
    """The axis of the lens and the object."""
    z, height = drawing["object"]
    end = drawing["image"][0]
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(z - 16, end + 17)
    axes.set_ylim(-1.35 * height, 1.35 * height)
    axes.plot([z - 4, end + 4], [0, 0], color=LINE, linewidth=0.8, zorder=0)
    axes.annotate(
        "", (z, height), (z, 0), arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.2}
    )
    _name(axes, (z - 1.5, height / 2), "object", "right")


def _lens(axes: Axes, drawing: dict[str, Any]) -> None:
    for outline in drawing["glasses"]:
        z, y = zip(*outline, strict=True)
        axes.fill(z, y, facecolor=_GLASS, edgecolor=INK, linewidth=0.8)
    place, radius = drawing["stop"]
    _bars(axes, place, radius, 5.0, INK)
    for color, bundle in zip(_RAYS, drawing["rays"], strict=True):
        for ray in bundle:
            z, y = zip(*ray, strict=True)
            axes.plot(z, y, color=color, linewidth=0.9)
    _sensor(axes, drawing["image"])


def _planes(axes: Axes, drawing: dict[str, Any]) -> None:
    front, rear = drawing["principal"]
    top = 1.1 * drawing["object"][1]
    # The planes of a triplet have changed places: the names stand outside of them.
    sides = ("left", "right") if front > rear else ("right", "left")
    for place, name, side in zip((front, rear), ("H", "H'"), sides, strict=True):
        axes.plot([place, place], [-top, top], color=SOFT, linewidth=1.0, linestyle=(0, (4, 3)))
        _name(axes, (place + (1 if side == "left" else -1), -top), name, side)
    for (place, radius), name, lift in zip(
        drawing["pupils"], ("entrance pupil", "exit pupil"), (0.93, 0.93), strict=True
    ):
        _bars(axes, place, radius, 3.0, INK)
        side = "right" if name == "exit pupil" else "left"
        step = -2.5 if side == "right" else 2.5
        _name(axes, (place + step, lift * top), name, side)
    start, image = drawing["object"], drawing["image"]
    (entrance, radius), _ = drawing["pupils"]
    for color, high in zip(_RAYS, (0.0, 1.0), strict=True):
        for edge in (-radius, 0.0, radius):
            slope = (edge - high * start[1]) / (entrance - start[0])
            meets = high * start[1] + slope * (front - start[0])
            z = (start[0], front, rear, image[0])
            axes.plot(z, (high * start[1], meets, meets, -high * image[1]), color=color, lw=0.9)
    _sensor(axes, image)


def _stop(axes: Axes, drawing: dict[str, Any]) -> None:
    start, half = drawing["object"], drawing["image"][1]
    place, radius = drawing["pupils"][0]
    image = place + drawing["image_distance"]
    _bars(axes, place, radius, 5.0, INK)
    for color, high in zip(_RAYS, (0.0, 1.0), strict=True):
        for edge in (-radius, 0.0, radius):
            y = (high * start[1], edge, -high * half)
            axes.plot((start[0], place, image), y, color=color, linewidth=0.9)
    _span(axes, place + 3, radius, "A")
    _sensor(axes, (image, half))


def _pinhole(axes: Axes, drawing: dict[str, Any]) -> None:
    start, half = drawing["object"], drawing["image"][1]
    place = drawing["pupils"][0][0]
    image = place + drawing["image_distance"]
    _bars(axes, place, 0.3, 9.0, INK)
    for color, high in zip(_RAYS, (0.0, 1.0), strict=True):
        y = (high * start[1], 0.0, -high * half)
        axes.plot((start[0], place, image), y, color=color, linewidth=0.9)
    _name(axes, (place - 3, -7.0), "every depth is sharp, no frequency is cut off", "right")
    _sensor(axes, (image, half))


def _bars(axes: Axes, place: float, radius: float, length: float, color: str) -> None:
    """An opening: what is above and below it is dark."""
    for side in (-1, 1):
        ends = [side * radius, side * (radius + length)]
        axes.plot([place, place], ends, color=color, linewidth=2.4, solid_capstyle="butt", zorder=4)


def _sensor(axes: Axes, image: Point | list[float]) -> None:
    place, half = image
    axes.plot([place, place], [-half, half], color=INK, linewidth=3.0, solid_capstyle="butt")
    _name(axes, (place + 2.5, 0.0), "sensor", "left")


def _span(axes: Axes, place: float, radius: float, text: str) -> None:
    arrow = {"arrowstyle": "<->", "color": INK, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (place, radius), (place, -radius), arrowprops=arrow)
    _name(axes, (place + 2, radius * 1.3), text, "left")


def _name(axes: Axes, place: Point, text: str, side: str) -> None:
    axes.text(*place, text, ha=side, va="center", fontsize=POINTS, color=INK, zorder=5)
