"""Phase retrieval on simulated propagation: how well thickness comes back, and from how far.

    python tools/check_paganin.py

A ball of one material, 100 pixels wide, is propagated by the angular spectrum of its exit wave on
a grid four times finer than the detector, and seen by the detector. Printed for several distances:
the Fresnel number of a pixel; the root mean square error of the recovered thickness as a share of
the ball's diameter, the largest error within four fifths of its radius, and the error of the
volume, each for the filter of 2002 and its generalised form; the same of the logarithm alone; and
the rows that a slab needs around it for an error of 1e-4 of the beam.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray

from rift_cl.reconstruct.preprocess import Propagation, paganin

Floats = NDArray[Any]
_SHAPE, _FINE, _RADIUS = (192, 224), 4, 50


@dataclass(frozen=True)
class Options:
    """Check phase retrieval.

    Args:
        distances: from the object to the detector, in metres.
        pixel: in metres.
        energy: in keV.
        delta: of the material.
        delta_beta: delta / beta of the material.
    """

    distances: tuple[float, ...] = (0.002, 0.005, 0.01, 0.02, 0.05)
    pixel: float = 1e-6
    energy: float = 20.0
    delta: float = 1e-6
    delta_beta: float = 500.0


def main(options: Options) -> None:
    """Print the table."""
    fine = _ball(options.pixel)
    truth, beta = _binned(fine), options.delta / options.delta_beta
    print("| distance | Fresnel number | 2002 | generalised | logarithm alone | halo rows |")
    print("| --: | --: | --: | --: | --: | --: |")
    for distance in options.distances:
        numbers: dict[str, float] = {
            "pixel": options.pixel,
            "distance": distance,
            "energy": options.energy,
            "delta_beta": options.delta_beta,
        }
        setting = Propagation(**numbers)
        seen = _propagated(fine, setting, options.delta)
        retrieved = [
            paganin(seen[None], **numbers, beta=beta, generalised=kind)[0] for kind in (False, True)
        ]
        mu = 4 * np.pi * beta / setting.wavelength
        cells = [_errors(found, truth) for found in (*retrieved, -np.log(seen) / mu)]
        fresnel = options.pixel**2 / (setting.wavelength * distance)
        print(
            f"| {distance:g} m | {fresnel:.2f} | {' | '.join(cells)} | {setting.halo_rows(1e-4)} |"
        )


def _errors(found: Floats, truth: Floats) -> str:
    y, x = (np.arange(n) - (n - 1) / 2 for n in _SHAPE)
    inside = y[:, None] ** 2 + x**2 < (0.8 * _RADIUS) ** 2
    away = (found - truth) / truth.max()
    volume = found.sum() / truth.sum() - 1
    return f"{np.sqrt(np.mean(away**2)):.2%}, {np.abs(away)[inside].max():.2%}, {volume:+.3%}"


def _ball(pixel: float) -> Floats:
    y, x = ((np.arange(n * _FINE) - (n * _FINE - 1) / 2) / _FINE for n in _SHAPE)
    return 2 * pixel * np.sqrt(np.maximum(_RADIUS**2 - y[:, None] ** 2 - x**2, 0))


def _propagated(thickness: Floats, setting: Propagation, delta: float) -> Floats:
    wavelength = setting.wavelength
    index = 1j * delta + delta / setting.delta_beta
    wave = np.exp(-2 * np.pi / wavelength * index * thickness)
    fy, fx = (np.fft.fftfreq(n, setting.pixel / _FINE) for n in thickness.shape)
    axial = np.sqrt(1 - wavelength**2 * (fy[:, None] ** 2 + fx**2)) - 1
    transfer = np.exp(2j * np.pi * setting.distance / wavelength * axial)
    return _binned(np.abs(np.fft.ifft2(np.fft.fft2(wave) * transfer)) ** 2)


def _binned(image: Floats) -> Floats:
    return image.reshape(_SHAPE[0], _FINE, _SHAPE[1], _FINE).mean(axis=(1, 3))


if __name__ == "__main__":
    main(tyro.cli(Options))
