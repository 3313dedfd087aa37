"""The power of a picture by spatial frequency: how fine what is missing is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import ShapeError
from rift_cl.metrics.scores import finite_values

# Cycles per pixel; the diagonals of the spectrum end at the square root of a half.
BAND_EDGES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.75)


def band_power(image: ArrayLike) -> NDArray[np.float64]:
    """Sums of squares of a picture in bands of radial spatial frequency.

    The transform is the orthonormal cosine transform: it continues a picture by its reflection, so
    that no jump between opposite borders adds power at high frequencies, and the powers of all
    bands add up to the sum of the picture's squares.

    Args:
        image: (height, width) or (height, width, channels), usually a difference of two.

    Returns:
        (n,) the power between neighbouring edges of ``BAND_EDGES``, in cycles per pixel, channels
        summed.

    Raises:
        ShapeError: the image has other axes or no pixel.
        DTypeError: it is not real.
        NonFiniteError: it holds NaN or infinity.
    """
    from scipy.fft import dctn

    values = finite_values("image", image)
    if values.ndim not in (2, 3) or not values.size:
        raise ShapeError(f"image has shape {values.shape}, wanted (height, width[, channels])")
    power = dctn(values, axes=(0, 1), norm="ortho") ** 2
    high, wide = values.shape[:2]
    # The k-th cosine has k half periods across the picture.
    radius = np.hypot(np.arange(high)[:, None] / (2 * high), np.arange(wide) / (2 * wide))
    total = power if power.ndim == 2 else power.sum(axis=2)
    return np.histogram(radius, BAND_EDGES, weights=total)[0].astype(np.float64)
