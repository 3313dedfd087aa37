"""What a tile wants of a splat on the screen, in float64: the twin of the splat_pack kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEATURES = 5
# The root's argument of ``reach`` gets so much more.
MARGIN = 1e-6


def screen_records(screen: Floats, features: Floats, whitening: Floats | None = None) -> Floats:
    """The records (N, 16) of ``kernels/include/raster/screen_record.h``.

    Args:
        screen: (N, 8): mean, conic a, b, c, weight, half sides of the ellipse's box.
        features: (N, D), of which the first five are in the record, zeros where D is less.
        whitening: (N, 3), i00, i10, i11 of L^-1; that of the conic if not given.
    """
    x, y, a, b, c, weight, across, down = screen.T
    if whitening is None:
        whitening = np.stack([np.sqrt(a - b**2 / c), b / np.sqrt(c), np.sqrt(c)], axis=1)
    narrow = 1 - b**2 / (a * c)
    bounds = [-b / c, -b / a * down, down * np.sqrt(narrow + MARGIN), across, 1 / across]
    shown = np.zeros((len(screen), FEATURES))
    shown[:, : features.shape[1]] = features[:, :FEATURES]
    places = np.sqrt(np.log2(np.e) / 2) * whitening
    numbers = np.stack([np.log2(weight), *bounds], axis=1)
    return np.concatenate([np.stack([x, y], axis=1), places, numbers, shown], axis=1)
