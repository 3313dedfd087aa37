"""Objects that are projected and reconstructed, and what is known of them beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.random_objects import RADIUS, mean_power, random_objects
from rift_cl import Projector
from rift_cl.sampling import PowerLaw, Prior, Spectrum, Target, half_disc

KINDS = {"isotropic": 1.0, "anisotropic": 8.0}
SIZE, NOISE = 96, 0.25
# Objects whose mean spectrum is taken as known; none of them is reconstructed.
_LEARNT, _LEARNT_SEED = 120, 99
_BAND, _FREQUENCIES = 24.0, 2400
# Of conjugate gradients.
_STEPS = 60

Floats = NDArray[np.float64]


class Objects:
    """Objects of one kind, in a disc, and the target that a merit takes them for.

    Args:
        kind: a key of ``KINDS``.
        count: how many.
    """

    def __init__(self, kind: str, count: int) -> None:
        stretch = KINDS[kind]
        self.fine = random_objects(count, 2 * SIZE, stretch, 0)
        learnt = coarse(random_objects(_LEARNT, 2 * SIZE, stretch, _LEARNT_SEED))
        self.truth = coarse(self.fine)
        self.power = mean_power(learnt, isotropic=kind == "isotropic")
        diameter = 2 * RADIUS * SIZE
        array = np.fft.fftshift(self.power)
        known = Spectrum(array, 1 / SIZE)
        prior: Prior = PowerLaw(_slope(array)) if kind == "isotropic" else known
        # Power at one cycle per diameter, over the noise's there: see
        # ``rift_cl.sampling.criteria.exact``.
        first = array[SIZE // 2, SIZE // 2] / known.power(np.zeros((1, 3)), diameter)[0]
        self.target = Target.flat(
            diameter,
            prior=prior,
            snr=float(first * SIZE**2 / (NOISE**2 * diameter)),
            band=_BAND / diameter,
            frequencies=half_disc(_BAND / diameter, _FREQUENCIES),
        )


def coarse(fine: Floats) -> Floats:
    """Means of two by two samples."""
    return np.asarray(fine.reshape(len(fine), SIZE, 2, SIZE, 2).mean((2, 4)))


def _slope(power: Floats) -> float:
    """Of the power law nearest to a spectrum, between 2 and 24 cycles per picture."""
    line = np.arange(2, int(_BAND))
    falling = power[SIZE // 2, SIZE // 2 + line]
    return -float(np.polyfit(np.log(line), np.log(falling), 1)[0])


def best_linear(A: Projector, y: Floats, power: Floats) -> Floats:
    """The estimate with the least expected error for objects with that mean spectrum.

    Conjugate gradients on ``(A' A / noise^2 + C^-1) x = A' y / noise^2``, preconditioned by what
    it would be on as many even directions, whose ``A' A`` weighs a frequency by views / (pi |k|).
    """
    line = np.fft.fftfreq(SIZE)
    k = np.maximum(np.hypot(line[:, None], line), 0.5 / SIZE)
    curvature = A.scan.angles.size / (np.pi * k * NOISE**2) + 1 / power

    def weighed(image: Any, by: Floats) -> Floats:
        return np.asarray(np.fft.ifft2(np.fft.fft2(image) * by).real)

    x = np.zeros(A.domain)
    residual = A.T(y) / NOISE**2
    direction = steepest = weighed(residual, 1 / curvature)
    slope = float((residual * steepest).sum())
    for _ in range(_STEPS):
        bent = A.T(A(direction)) / NOISE**2 + weighed(direction, 1 / power)
        length = slope / float((direction * bent).sum())
        x, residual = x + length * direction, residual - length * bent
        steepest = weighed(residual, 1 / curvature)
        slope, before = float((residual * steepest).sum()), slope
        direction = steepest + slope / before * direction
    return x
