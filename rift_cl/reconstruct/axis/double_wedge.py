"""Half turns: the sinogram of the whole turn that a half turn and its mirror image make.

A point at the distance r from the axis is seen, over a whole turn, with angular frequencies m up to
r k at the frequency k along the detector, so that the two-dimensional Fourier transform of a whole
turn is empty beyond: outside a double wedge (Edholm, Lewitt and Lindholm, Proc. SPIE 671, 8, 1986;
Vo et al., Optics Express 22, 19078, 2014, who find the centre by it). Views turned round about a
wrong centre do not continue the others, and fill the empty part.

With P(m, k) the transform of the half turn alone, over angles that go on with zeros for the other
half, the whole is ``P(m, k) + (-1)^m exp(-2i k c) conj P(-m, k)``, so that the energy at (m, k)
depends on the centre c through ``C = (-1)^m P(m, k) P(-m, k)`` only. Where the wedge ends is not
assumed but read from the data: energies are weighted by one over their local mean, which is the
noise outside the wedge and so much larger inside that what lies there counts for nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.evidence import Evidence
from rift_cl.reconstruct.axis.views import Row, spectra

Floats = NDArray[np.float64]
Energies = NDArray[np.float32]
Spectrum = NDArray[np.complex64]

# How far a centre may be from the one that the mean energies are taken at, in bins of the row:
# where frequencies are so high that this matters, they come from the half turn alone.
_DOUBT = 1.0
# Box over which energies are averaged, in angular frequencies and frequencies along the detector.
_BOX = (9, 5)
# Means below so many times the noise count as noise; frequencies over which noise is averaged.
_NOISE, _BLUR = 2.0, 9
# Degrees of freedom of the t-distribution.
_FREEDOM = 5.0


def wedge_evidence(row: Row, window: float, near: float | None) -> Evidence:
    """What a half turn says of its axis.

    Args:
        row: views spread evenly over half a turn, its end left out.
        window: centre, in bins of the row, of the part of the detector that is looked at.
        near: the centre as far as it is known, in bins of the row; None where it is not.

    Returns:
        The evidence; it says nothing (all of its terms are 0) where the window holds nothing.
    """
    from scipy.fft import fft
    from scipy.ndimage import uniform_filter

    half = spectra(row, window)
    views = half.values.shape[0]
    forth, back = _angular(fft(half.values, 2 * views, axis=0))
    sign = np.where(np.arange(views + 1) % 2, -1, 1).astype(np.float32)[:, None]
    taper = np.sqrt(8 / 3) * np.sin(np.pi * (np.arange(views) + 0.5) / views) ** 2
    tapered = half.values * taper.astype(np.float32)[:, None]
    energy = _energies(*_angular(fft(tapered, 2 * views, axis=0)))
    if near is not None:
        whole = np.abs(forth + sign * half.turned(near) * back.conj()) ** 2
        known = np.exp(-2 * (half.frequencies * _DOUBT) ** 2).astype(np.float32)
        energy = known * whole + (1 - known) * energy
    if not energy.max() > 0:
        return half.evidence(np.zeros(half.frequencies.size, np.complex128), row, _FREEDOM)
    mean = uniform_filter(energy, _BOX, mode="nearest")
    noise = _noise(energy)
    weights = 1 / np.where(mean < _NOISE * noise, noise, mean)
    # Zero and the highest angular frequency stand for themselves alone, the others for two.
    weights[[0, -1]] /= 2
    terms = (weights * sign * forth * back).sum(axis=0, dtype=np.complex128)
    return half.evidence(terms, row, _FREEDOM)


def _angular(transform: Spectrum) -> tuple[Spectrum, Spectrum]:
    """The transform at angular frequencies 0, 1, ... and at 0, -1, ..."""
    count = len(transform) // 2 + 1
    return transform[:count], transform[-np.arange(count)]


def _energies(forth: Spectrum, back: Spectrum) -> Energies:
    energies: Energies = np.abs(forth) ** 2 + np.abs(back) ** 2
    return energies


def _noise(energy: Energies) -> Energies:
    """Mean energy of noise at each frequency along the detector, which fills the wedge's outside.

    The median is not moved by the part of the object that reaches the upper half of angular
    frequencies; energies of noise are distributed exponentially, with the median log 2.
    """
    from scipy.ndimage import uniform_filter1d

    noise = np.median(energy[len(energy) // 2 :], axis=0) / np.log(2)
    least = 1e-12 * energy.max()
    floor: Energies = np.maximum(uniform_filter1d(noise, _BLUR, mode="nearest"), least)
    return floor
