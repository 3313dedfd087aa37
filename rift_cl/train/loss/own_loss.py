"""What is asked of a pixel loss that a user registers, before a fit begins.

Its two expressions are evaluated at some differences of a pixel: both are to be finite, and the
gradient is to be the slope of the value, unless it is said to stand for another one. A sign that is
wrong would otherwise end in a fit that is merely bad. Nor may a loss fall as images differ more.
"""

from __future__ import annotations

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.errors import InputError, KernelBuildError
from rift_cl.train.loss.image_loss import ImageLoss
from rift_cl.train.loss.pixel_loss import OURS, PIXEL_LOSSES

# Differences of pixels, away from round numbers, where a loss may have an edge.
_AT = np.array([-0.93, -0.61, -0.37, -0.19, -0.071, -0.023, 0.017, 0.059, 0.23, 0.41, 0.67, 0.89])
_STEP = 2e-3
# Of the slope, and of the largest slope: float32 sums and differences of so wide a step.
_RELATIVE, _ABSOLUTE = 0.03, 0.01
# How many of the slopes may differ: a loss may have edges.
_EDGES = 2

_SUFFIX = "; numbers want an f behind them, so write 1e-4f, and not 1e-4"
_VECTORS = (
    "; d and m are vectors on this device, so write m * sign(d), and not m * (d > 0 ? 1 : -1)"
)


def check_own_loss(device: Device, name: str) -> None:
    """Check a loss by its name; those of the package pass unseen.

    Raises:
        InputError: it does not compile, gives NaN or infinity, has no gradient at all, one that
            points away from the images, or one that is not the slope of its value.
    """
    if name in OURS:
        return
    loss = PIXEL_LOSSES[name]
    try:
        found = [_evaluated(device, name, float(at)) for at in (*_AT, 0.0)]
        either = [[_evaluated(device, name, float(at + s * _STEP))[0] for s in (1, -1)]
                  for at in _AT]  # fmt: skip
    except KernelBuildError as error:
        reason = str(error).splitlines()[-1]
        hint = _SUFFIX if "double" in reason else _VECTORS if "vector" in reason else ""
        raise InputError(f"pixel loss {name!r} does not compile{hint}: {reason}") from error
    values, slopes = np.array(found).T
    bad = ~(np.isfinite(values) & np.isfinite(slopes))
    if bad.any():
        at = np.flatnonzero(bad)[0]
        raise InputError(
            f"pixel loss {name!r}: at d = {[*_AT, 0][at]:g} the value is {values[at]:.4g} and the "
            f"gradient {slopes[at]:.4g}, wanted finite numbers"
        )
    values, slopes = values[:-1], slopes[:-1]
    if not slopes.any():
        raise InputError(f"pixel loss {name!r}: its gradient is 0 everywhere, nothing would be fit")
    differences = -np.diff(np.array(either), axis=1)[:, 0] / (2 * _STEP)
    room = _RELATIVE * np.maximum(np.abs(slopes), np.abs(differences)) + _ABSOLUTE * max(
        np.abs(slopes).max(), np.abs(differences).max()
    )
    off = np.abs(slopes - differences) - room
    if not loss.surrogate and (off > 0).sum() > _EDGES:
        at = int(np.argmax(off))
        raise InputError(
            f"pixel loss {name!r}: at d = {_AT[at]:g} the gradient is {slopes[at]:.4g} and the "
            f"slope of the value {differences[at]:.4g}; if it is meant to be another, say "
            "PixelLoss(..., surrogate=True)"
        )
    if ((slopes * _AT) < 0).sum() > _EDGES:
        raise InputError(
            f"pixel loss {name!r}: its gradient at d = {_AT[-1]:g} is {slopes[-1]:.4g} and at d = "
            f"{_AT[0]:g} {slopes[0]:.4g}: it falls as images differ more, so that a fit would move "
            "away from them"
        )


def _evaluated(device: Device, name: str, difference: float) -> tuple[float, float]:
    """Value and gradient at a difference."""
    target = np.full((1, 1, 3), 0.5, np.float32)
    image = target + np.float32(difference)
    value, gradient = ImageLoss(0, name)(device, device.array(image), device.array(target))
    # The mean over three channels, each of which has a third of the slope.
    return float(device.get(value)[0]), float(device.get(gradient).sum())
