"""From what a file holds to what is drawn, and back: the activations of 3D Gaussian splatting.

Files hold logarithms of scales and logits of opacities (Kerbl et al. 2023). Every function takes
finite numbers to finite numbers: what float32 cannot hold becomes the nearest that it can.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# The first coefficient of the harmonics times this, plus 1/2, is the colour of degree 0.
HARMONIC_0 = 0.28209479177387814

_FLOAT = np.finfo(np.float32)
_BELOW_ONE = float(np.nextafter(np.float32(1), np.float32(0)))


def scales_of(log_scales: NDArray[np.float32]) -> NDArray[np.float32]:
    """Standard deviations from their logarithms."""
    with np.errstate(all="ignore"):
        return _narrowed(np.exp(log_scales, dtype=np.float64))


def log_scales_of(scales: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logarithms of standard deviations; of the smallest normal number where one is zero."""
    return _narrowed(np.log(np.clip(scales, _FLOAT.tiny, _FLOAT.max), dtype=np.float64))


def opacities_of(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Opacities from their logits."""
    with np.errstate(all="ignore"):
        return _narrowed(1 / (1 + np.exp(-logits, dtype=np.float64)))


def logits_of(opacities: NDArray[Any]) -> NDArray[np.float32]:
    """Logits of opacities; of the float32 numbers nearest to 0 and 1 where they are 0 and 1."""
    inside = np.clip(opacities.astype(np.float64), _FLOAT.tiny, _BELOW_ONE)
    return _narrowed(np.log(inside) - np.log1p(-inside))


def _narrowed(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.clip(values, None, _FLOAT.max).astype(np.float32)
