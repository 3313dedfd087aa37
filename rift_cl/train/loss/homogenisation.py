"""Spectral homogenisation: the loss pulls at every frequency alike.

A set of views samples low frequencies too densely, and natural pictures hold most of their power
there, so that a plain residual spends its steps on what is nearly right already. Here the gradient
of the pixelwise part is multiplied by a ramp in the Fourier domain of the image,

    (k^2 + k0^2)^(p/2),    k in cycles per pixel, k0 one cycle over the longer edge,

and scaled back to the norm it had; that of D-SSIM, a high-pass itself, stays as it is. X-ray views
of an orbit are too dense along the detector's rows alone: there k is the frequency along x.

Both are what views that lie evenly sample. The weight may be what was counted instead: one over
the coverage L of the frequency by all views, to the power p, which is k^p for even views on a
sphere (``rift_cl.train.loss.coverage_weight``). As every view keeps its norm, that weighs the
frequencies of a view against each other, and does not make up for views that lie close together.

Either amplifies noise as well, and once only noise is left of the residual a flat weight is the
best there is. So the exponent falls with the share of the residual that is noise,

    p = exponent (1 - noise^2 / mean square residual),    not below zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
import scipy
from numpy.typing import NDArray
from tyro.conf import arg

from rift_cl.errors import SettingError
from rift_cl.geometry.numbers import one_number
from rift_cl.option_marks import Expert

Floats = NDArray[np.float64]
WeightKind = Literal["ramp", "coverage"]

# Exponent from so many photographs on, where none is given: with 8 to 36 the ramp never gained,
# with 64 short fits did, and long ones lost nothing (docs/explanation/homogenisation.md).
USUAL_EXPONENT, ENOUGH_VIEWS = 0.5, 40
_STEEPEST = 4.0
# Immerkaer's mask, which leaves out what is linear along an edge; its norm is 6. Noise is read off
# the calmest share of the pixels, where there is the least texture to be taken for noise.
_MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]]) / 6
_CALM = 0.25


@dataclass(frozen=True)
class Homogenisation:
    """Weight of spatial frequencies in the gradient of the pixel loss.

    Raises:
        InputError: the exponent is out of its range, or the weight unknown.
    """

    exponent: Annotated[
        float | None, arg(name="homogenise", prefix_name=False, help_behavior_hint="")
    ] = 0.0
    """Exponent of the weight of the residual's frequencies, so that fine detail counts as much as
    coarse, 0 to 4 (0 = none). Default: 0 for X-rays; for photographs 0.5, or 0 for fewer than
    40."""
    weight: Annotated[WeightKind, arg(name="homogenise-by", prefix_name=False)] = "ramp"
    """What is raised to the exponent of --homogenise: the frequency (ramp), or one over the
    coverage of the frequency by all views (coverage). Neither makes up for uneven spacing of
    views, each of which counts as before."""
    noise_aware: Expert[bool] = True
    """Lower the exponent as the residual comes down to the noise of the images."""
    along_rows: Expert[bool] = False
    """Weight frequencies along the rows of an image alone, as for the projections of an orbit."""

    def __post_init__(self) -> None:
        """Check the exponent and the weight's name."""
        if self.exponent is not None and not 0 <= one_number(self.exponent) <= _STEEPEST:
            raise SettingError(self, "exponent", f"is {self.exponent!r}, wanted 0 to {_STEEPEST:g}")
        if self.weight not in get_args(WeightKind):
            wanted = " or ".join(get_args(WeightKind))
            raise SettingError(self, "weight", f"is {self.weight!r}, wanted {wanted}")

    def response(self, ky: Floats, kx: Floats, *, longest: int, exponent: float) -> Floats:
        """The ramp at frequencies in cycles per pixel, for an image with that longer edge."""
        square = (kx**2 if self.along_rows else ky**2 + kx**2) + 1 / longest**2
        return np.asarray(square ** (exponent / 2))

    def decided(self, views: int) -> Homogenisation:
        """These settings, with the exponent decided by the number of views if it was left open."""
        if self.exponent is not None:
            return self
        enough = views >= ENOUGH_VIEWS or self.weight == "coverage"
        return replace(self, exponent=USUAL_EXPONENT if enough else 0.0)

    def exponent_at(self, mean_square: float, noise: float) -> float:
        """The exponent for a mean square residual and a standard deviation of the noise."""
        most = self.exponent or 0.0
        if not self.noise_aware or noise == 0:
            return most
        return most * max(0.0, 1 - noise**2 / mean_square)


def noise_of(images: Sequence[NDArray[np.float32]]) -> float:
    """The standard deviation of white noise in pictures (Immerkaer 1996), a median over them.

    Args:
        images: (height, width, C) of any unit.
    """
    found = []
    for image in images:
        rough = np.concatenate([_roughness(image[..., c]) for c in range(image.shape[2])])
        found.append(float(np.quantile(rough, _CALM)) / scipy.special.ndtri((1 + _CALM) / 2))
    return float(np.median(found))


def _roughness(channel: NDArray[np.float32]) -> Floats:
    inner = scipy.ndimage.convolve(channel.astype(float), _MASK, mode="nearest")[1:-1, 1:-1]
    return np.asarray(np.abs(inner).ravel())
