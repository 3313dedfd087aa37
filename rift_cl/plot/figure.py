"""What all figures share: ink, size, values that can be drawn, and the way to a PNG.

Only matplotlib's objects are used, never its global state, so that a program that plots for itself
is not disturbed.
"""

from __future__ import annotations

import io
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
POINTS = 8.5
_COMPRESSION = 3

Reals = NDArray[np.float64]


def real_values(name: str, values: ArrayLike, *, axes: int = 1) -> Reals:
    """Values that can be drawn, with so many axes.

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
    return array.astype(np.float64)


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
