"""How well an axis could be told at all: by a search that knows what it can only estimate.

The double wedge weights energies by one over their expectation (``double_wedge.py``), which a
search has to read from the one sinogram that it is given. Here it is known instead, as the mean
over many other objects of the same kind with the axis at its true place; so is the noise, and the
search begins at the axis. With Gaussian statistics these are the weights of the likeliest centre,
so that no other weighting of the same views can be expected to do better.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft
from scipy.ndimage import uniform_filter

from bench.axis_cases import AxisCase, Kind
from rift_cl.reconstruct.axis.evidence import Evidence
from rift_cl.reconstruct.axis.views import Row, Spectra, spectra

Floats = NDArray[np.float64]

# Box over which the mean energies of other objects are smoothed, in angular frequencies and
# frequencies along the detector; it takes out what few objects leave of chance.
_BOX = (3, 3)
# So many degrees of freedom make a t-distribution a normal one.
_NORMAL = 1e4
# How far about the axis is searched, and the step, in bins.
_REACH, _STEP = 2.0, 0.05


@dataclass(frozen=True)
class Limit:
    """Errors of a search that knows the expected energies, in bins."""

    errors: Floats

    def __str__(self) -> str:
        """One line."""
        size = np.abs(self.errors)
        return (
            f"root mean square {np.sqrt(np.mean(size**2)):.3f}, median {np.median(size):.3f}, "
            f"{np.mean(size <= 0.1):.0%} within 0.1 bin"
        )


def limit_of(kind: Kind, bins: int, offset: float, noise: float, *, count: int, seed: int) -> Limit:
    """The errors over some objects of a kind, half turns, each weighted by all the others.

    Args:
        kind: of objects, all cut by the detector or none.
        bins: of the detector.
        offset: of the axis, as a share of the bins.
        noise: as a share of the greatest line integral.
        count: of objects.
        seed: of the first.
    """
    cut = kind == "texture"
    cases = [AxisCase(bins, offset, kind, noise, 180, seed + k) for k in range(count)]
    clean = [AxisCase(bins, offset, kind, 0.0, 180, seed + k).sinogram() for k in range(count)]
    noisy = [case.sinogram() for case in cases]
    center = cases[0].center
    energies = [_energy(views, center, cut) for views in clean]
    strays = [
        _energy(views - whole, center, cut) for views, whole in zip(noisy, clean, strict=True)
    ]
    total, stray = np.sum(energies, axis=0), float(np.mean(strays))
    trial = center + np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    errors = []
    for views, own in zip(noisy, energies, strict=True):
        expected = uniform_filter((total - own) / (count - 1), _BOX, mode="nearest") + stray
        told = _evidence(views, center, cut, 1 / expected)
        errors.append(told.peak(float(trial[told.scores(trial).argmax()])) - center)
    return Limit(np.array(errors))


def _angular(part: Spectra) -> tuple[NDArray[np.complex64], NDArray[np.complex64], Floats]:
    """Transforms over angles that go on with zeros: forth, back, and the sign of the mirror."""
    views = len(part.values)
    transform = fft(part.values, 2 * views, axis=0)
    order = np.arange(views + 1)
    return transform[order], transform[-order], np.where(order % 2, -1.0, 1.0)[:, None]


def _energy(views: NDArray[np.float32], center: float, cut: bool) -> Floats:
    """Energies of the whole turn that a half turn and its mirror image about the axis make."""
    part = spectra(Row(views, 1, cut), center)
    forth, back, sign = _angular(part)
    whole: Floats = np.abs(forth + sign * part.turned(center) * back.conj()) ** 2
    return whole


def _evidence(views: NDArray[np.float32], center: float, cut: bool, weights: Floats) -> Evidence:
    row = Row(views, 1, cut)
    part = spectra(row, center)
    forth, back, sign = _angular(part)
    weights[[0, -1]] /= 2
    return part.evidence((weights * sign * forth * back).sum(axis=0), row, _NORMAL)
