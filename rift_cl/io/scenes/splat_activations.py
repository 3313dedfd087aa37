"""From what a file holds to what is drawn, and back: the activations of 3D Gaussian splatting.

Files hold logarithms of scales and logits of opacities (Kerbl et al. 2023); where densities are
drawn as optical depths (``SplatSettings.activation``) the same logits stand for those. Every
function takes finite numbers to finite numbers: what float32 cannot hold becomes the nearest that
it can.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.splat.settings import Activation, SplatMode

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


def amplitudes_of(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Optical depths -ln(1 - opacity) from the logits of opacities: softplus(logit)."""
    with np.errstate(all="ignore"):
        return _narrowed(np.logaddexp(0, logits, dtype=np.float64))


def logits_of_amplitudes(amplitudes: NDArray[Any]) -> NDArray[np.float32]:
    """Logits of the opacities that optical depths at a splat's peak make."""
    inside = np.clip(amplitudes.astype(np.float64), _FLOAT.tiny, _FLOAT.max)
    return _narrowed(inside + np.log(-np.expm1(-inside)))


def logits_of(opacities: NDArray[Any]) -> NDArray[np.float32]:
    """Logits of opacities; of the float32 numbers nearest to 0 and 1 where they are 0 and 1."""
    inside = np.clip(opacities.astype(np.float64), _FLOAT.tiny, _BELOW_ONE)
    return _narrowed(np.log(inside) - np.log1p(-inside))


def drawn_strengths(
    logits: NDArray[np.float32], mode: SplatMode, activation: Activation
) -> NDArray[np.float32]:
    """What a splat is drawn with: densities in xray mode, optical depths, or opacities."""
    if mode == "xray":
        return scales_of(logits)
    return (opacities_of if activation == "clamp" else amplitudes_of)(logits)


def kept_strengths(
    drawn: NDArray[np.float32], mode: SplatMode, activation: Activation
) -> NDArray[np.float32]:
    """Undoes ``drawn_strengths``.

    Raises:
        InputError: there are none that a file could hold.
    """
    bounded = mode == "light" and activation == "clamp"
    check_range("opacities", drawn, 1 if bounded else np.inf)
    if mode == "xray":
        return log_scales_of(drawn)
    return (logits_of if bounded else logits_of_amplitudes)(drawn)


def check_range(name: str, values: NDArray[np.float32], most: float) -> None:
    """Check that scales or opacities have logarithms or logits.

    Raises:
        InputError: some lie outside 0 to ``most``.
    """
    outside = np.count_nonzero((values < 0) | (values > most))
    if outside:
        raise InputError(
            f"SplatScene: {name} hold {outside} values outside 0 to {most:g}, whose "
            f"{'logits' if name == 'opacities' else 'logarithms'} do not exist"
        )


def _narrowed(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.clip(values, None, _FLOAT.max).astype(np.float32)
