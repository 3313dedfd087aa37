"""A response in the Fourier domain of images by NumPy's transform: twin of the fft kernels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def spectrally_filtered(
    image: Floats, response: Callable[[Floats, Floats], Floats], padded: tuple[int, int]
) -> Floats:
    """The (height, width, D) image, continued by zeros to ``padded``, filtered, cut out again."""
    height, width = image.shape[:2]
    along_y, along_x = (np.asarray(np.fft.fftfreq(n), np.float64) for n in padded)
    weights = np.broadcast_to(response(along_y[:, None], along_x[None, :]), padded)
    spectrum = np.fft.fft2(image, s=padded, axes=(0, 1)) * weights[..., None]
    return np.asarray(np.fft.ifft2(spectrum, axes=(0, 1)).real[:height, :width])
