"""What all figures share: ink, size, values that can be drawn, and the way to a file.

Only matplotlib's objects are used, never its global state, so that a program that plots for itself
is not disturbed. Reports take figures as SVG files, whose ink follows the reader's colour scheme.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, NonFiniteError, ShapeError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 160
INK, SOFT, LINE = "#1c1d1f", "#63666b", "#c9ccd0"
# Okabe and Ito's palette, told apart by colour-blind readers; its yellow is too pale for lines.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", INK)
# The same colours on a dark page.
_DARK = {
    INK: "#e4e5e7", SOFT: "#9da1a7", LINE: "#44474c", "#0072b2": "#4a9fe0", "#d55e00": "#ff8a3d",
    "#009e73": "#2cc99b", "#cc79a7": "#e39ac4", "#56b4e9": "#9fd8ff", "#e69f00": "#f5bd3f",
}  # fmt: skip
POINTS = 8.5
# Pixels across a figure for wide pages, and for those of a telephone.
WIDE, NARROW = 1024, 576
_COMPRESSION = 3

Reals = NDArray[np.float64]


def real_values(name: str, values: ArrayLike, *, axes: int = 1) -> Reals:
    """Values that can be drawn, with so many axes, as float64; errors as ``drawable``."""
    return drawable(name, values, axes=axes).astype(np.float64)


def drawable(name: str, values: ArrayLike, *, axes: int) -> NDArray[Any]:
    """Values that can be drawn, with so many axes, as they are.

    Raises:
        ShapeError: they have other axes, or there are none.
        DTypeError: they are not real numbers.
        NonFiniteError: one is NaN or infinite.
    """
    array: NDArray[Any] = np.asarray(values)
    if array.dtype.kind not in "biuf":
        raise DTypeError(f"{name} has type {array.dtype}, wanted real numbers")
    if array.ndim != axes or array.size == 0:
        raise ShapeError(f"{name} has shape {array.shape}, wanted {axes} axes and a sample or more")
    if not np.isfinite(array).all():
        raise NonFiniteError(f"{name} holds NaN or infinity; replace such values before plotting")
    return array


def new_figure(width: int, height: int) -> Figure:
    """An empty figure of so many pixels."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")


def add_panel(figure: Figure, left: float, top: float, wide: float, high: float) -> Axes:
    """Axes whose frame has so many pixels, and lies so many from the figure's left and top edge."""
    width, height = figure.get_size_inches() * DPI
    return figure.add_axes((left / width, 1 - (top + high) / height, wide / width, high / height))


def figure_png(figure: Figure) -> bytes:
    """The figure as the content of a PNG file, the same bytes for the same figure."""
    buffer = io.BytesIO()
    # As small as by the usual 6 for images of samples, in two thirds of the time.
    options = {"compress_level": _COMPRESSION}
    figure.savefig(
        buffer, format="png", dpi=figure.dpi, metadata={"Software": None}, pil_kwargs=options
    )
    return buffer.getvalue()


def figure_svg(figure: Figure) -> bytes:
    """The figure as the content of an SVG file without background, the same for the same figure.

    Its ink and palette are lighter where the reader prefers a dark scheme. It begins with its
    width and height in pixels. Text is drawn as outlines, so that no font is needed.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue().decode("utf-8")
    text = _numbered(re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL))
    text = text.replace(": #000000", f": {INK}")
    for place, color in enumerate(_DARK):
        text = text.replace(f": {color}", f": var(--c{place})")
    wide, high = (round(length * figure.dpi) for length in figure.get_size_inches())
    body = text[text.index(">", text.index("<svg ")) + 1 :]
    box = " ".join(f"{72 * length:g}" for length in figure.get_size_inches())
    head = (
        f'<svg width="{wide}" height="{high}" viewBox="0 0 {box}" version="1.1" '
        'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    light, dark = (
        " ".join(f"--c{place}: {color};" for place, color in enumerate(colors))
        for colors in (_DARK, _DARK.values())
    )
    # What matplotlib leaves black has no fill of its own.
    style = (
        f"svg {{ {light} fill: var(--c0); }} "
        f"@media (prefers-color-scheme: dark) {{ svg {{ {dark} }} }}"
    )
    return f"{head}<style>{style}</style>{body}".encode()


def figure_svgs(draw: Callable[[int], Figure]) -> tuple[bytes, bytes]:
    """A figure for wide pages and for narrow ones: ``draw`` is given the pixels across it."""
    return figure_svg(draw(WIDE)), figure_svg(draw(NARROW))


def _numbered(svg: str) -> str:
    """An SVG file with short names in place of matplotlib's, which chance has a part in."""
    names = dict.fromkeys(re.findall(r'\bid="([^"]+)"', svg))
    short = {name: f"n{number}" for number, name in enumerate(names)}
    svg = re.sub(r'\bid="([^"]+)"', lambda found: f'id="{short[found[1]]}"', svg)
    return re.sub(r'#([^")\s]+)(?=["\)])', lambda found: f"#{short.get(found[1], found[1])}", svg)
