"""An image in a figure whose pixels are the figure's own; imports Matplotlib.

Axes would resample it in floating point, 112 bytes for each pixel, which is more than what many a
slice needs to be reconstructed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import FigureImage
from numpy.typing import NDArray


class Pixels(FigureImage):
    """Pixels that are drawn as they are.

    Args:
        figure: where to draw them.
        codes: (y, x, 3) uint8.
        left, low: pixels from the figure's left and lower edge.
    """

    def __init__(self, figure: Figure, codes: NDArray[np.uint8], left: int, low: int) -> None:
        super().__init__(figure, offsetx=left, offsety=low, origin="upper")
        opaque = np.full((*codes.shape[:2], 1), 255, np.uint8)
        self.set_data(np.concatenate([codes, opaque], axis=2))

    def make_image(self, *_: Any, **__: Any) -> Any:
        """The pixels from the lowest row on, and where they begin."""
        return np.asarray(self.get_array())[::-1], self.ox, self.oy, None
