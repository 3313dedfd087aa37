"""What stays unknown, counted with what views tell twice: for reports, not for optimising.

The diagonal merits add up views as if each brought news. Close to a frequency, slices of several
views lie within the width of the target's window and tell the same; kriging takes their
correlation into account (Matheron 1963; the same as Gaussian-process regression).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rift_cl.optics.optical_transfer import Floats, optical_transfer
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import checked_power

if TYPE_CHECKING:
    from rift_cl.sampling.targets.target import Target

# Slices that take part in one estimate, and estimates that are made at once.
_NEAREST, _AT_ONCE = 24, 256
# Noise of a view that tells nothing, relative to what it might tell.
_NOTHING = 1e12


def kriging(observations: Observations, target: Target) -> float:
    """Posterior variance as in ``wiener``, but with correlations between views.

    Each frequency is estimated from the nearest points of the 24 slices closest to it:
    ``S (1 - r^T (R + N)^-1 r)``, where r and R are correlations by the target's window, a disc or
    a ball, and N is the noise of each, ``1 / (snr S w MTF^2)``.

    Args:
        observations: V views of the target's points.
        target: its frequencies, prior and signal-to-noise ratio count.
    """
    power = checked_power(target.prior, target.k, target.diameter)
    shares = [
        _shares(observations, point, target, power) for point in range(observations.weight.shape[1])
    ]
    return float(np.mean([power @ share for share in shares]) / power.sum())


def _shares(observations: Observations, point: int, target: Target, power: Floats) -> Floats:
    parts = [
        _some(observations, point, target, target.k[first:last], power[first:last])
        for first in range(0, len(power), _AT_ONCE)
        for last in [first + _AT_ONCE]
    ]
    return np.concatenate(parts)


def _some(
    observations: Observations, point: int, target: Target, k: Floats, power: Floats
) -> Floats:
    """Unknown shares of some frequencies (K,)."""
    normals = observations.direction[:, point]
    offsets = k @ normals.T
    near = np.argsort(np.abs(offsets), axis=1, kind="stable")[:, :_NEAREST]
    u, n = np.take_along_axis(offsets, near, 1), normals[near]
    places = k[:, None] - u[..., None] * n
    passed = optical_transfer(
        np.linalg.norm(places, axis=2),
        *(
            values[near, point]
            for values in (observations.pixel, observations.cutoff, observations.blur)
        ),
    ).value
    told = target.snr * power[:, None] * observations.weight[near, point] * passed**2
    noise = np.minimum(1 / np.maximum(told, 1 / _NOTHING), _NOTHING)
    window = _disc if target.is_flat else _ball
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    correlation = window(target.diameter * apart)
    diagonal = np.arange(near.shape[1])
    correlation[:, diagonal, diagonal] += noise
    wanted = window(target.diameter * np.abs(u))
    solved = np.linalg.solve(correlation, wanted[..., None])[..., 0]
    return np.asarray(np.clip(1 - (wanted * solved).sum(1), 0, 1))


def _disc(cycles: Floats) -> Floats:
    """Fourier transform of a disc of diameter 1, 1 at zero: 2 J1(x) / x with x = pi cycles."""
    from scipy.special import j1

    x = np.pi * np.maximum(cycles, 1e-6)
    return np.asarray(2 * j1(x) / x)


def _ball(cycles: Floats) -> Floats:
    """Fourier transform of a ball of diameter 1: 3 j1(x) / x with the spherical Bessel function."""
    from scipy.special import spherical_jn

    x = np.pi * np.maximum(cycles, 1e-6)
    return np.asarray(3 * spherical_jn(1, x) / x)
