"""How near a volume comes to a phantom where every scan about it sees it: in a ball."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

# Of the ball, as a share of the volume's edge.
_RADIUS = 0.48


def ball_psnr(volume: Any, truth: Any) -> float:
    """PSNR within the ball of 0.48 of the edge, against the phantom's largest value, in dB.

    Args:
        volume: (n, n, n) samples.
        truth: those of the phantom.
    """
    n = len(truth)
    places = np.arange(n) - (n - 1) / 2
    squares = sum(np.meshgrid(*[places**2] * 3, indexing="ij", sparse=True))
    error = (volume - truth)[squares <= (_RADIUS * n) ** 2].astype(np.float64)
    return 10 * math.log10(float(truth.max()) ** 2 / float(np.mean(error**2)))
