"""Zinger removal beside algotom's: what is found, what is taken for a zinger, what it costs.

    python tools/compare_zingers.py

Balls in a cylinder, half a turn of 360 views of 24 rows and 256 bins, photons counted after the
flat-field correction; then zingers in one pixel of 10,000, of 0.3 to 3 times the beam. Printed for
several fluxes: the share of clean pixels that are replaced, before there are any zingers, and the
share of zingers that are found. The remove_zinger of algotom, which works on one projection at a
time, is run at both ends of the range of thresholds that its documentation recommends.

algotom is needed: pip install algotom.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray

from rift_cl.reconstruct.preprocess import remove_zingers

Floats = NDArray[Any]
_SHAPE = (360, 24, 256)


@dataclass(frozen=True)
class Options:
    """Compare zinger removal.

    Args:
        fluxes: photons a pixel in the middle of the beam.
        seed: of the object, the photons and the zingers.
    """

    fluxes: tuple[int, ...] = (10, 100, 1_000, 10_000, 100_000)
    seed: int = 1


def main(options: Options) -> None:
    """Print the tables."""
    random = np.random.default_rng(options.seed)
    ideal = _transmission(random)
    hit = random.random(_SHAPE) < 1e-4
    heights = hit * random.uniform(0.3, 3, _SHAPE)
    methods = _methods()
    print("clean pixels replaced (their share), zingers found")
    print("| photons | " + " | ".join(methods) + " |")
    print("| --: |" + " --: |" * len(methods))
    for flux in options.fluxes:
        beam = flux * np.exp(-3 * np.linspace(-0.5, 0.5, _SHAPE[2]) ** 2)
        clean = (random.poisson(ideal * beam) / beam).astype(np.float32)
        struck = (clean + heights).astype(np.float32)
        cells = []
        for method in methods.values():
            false = np.mean(method(clean) != clean)
            found = np.mean((method(struck) != struck)[hit])
            cells.append(f"{false:.1e}, {found:.1%}")
        print(f"| {flux:,} | " + " | ".join(cells) + " |")
    print("\nprocessor seconds for 360 projections of 24 x 256, median of 3")
    for name, method in methods.items():
        print(f"{name}: {_seconds(method, struck):.3f}")


def _methods() -> dict[str, Callable[[Floats], Floats]]:
    from algotom.prep.removal import remove_zinger

    def peer(threshold: float) -> Callable[[Floats], Floats]:
        return lambda stack: np.stack([remove_zinger(view, threshold) for view in stack])

    return {
        "ours": lambda stack: remove_zingers(stack)[0],
        "ours, 5 x 5": lambda stack: remove_zingers(stack, size=5)[0],
        "algotom, 0.05": peer(0.05),
        "algotom, 0.1": peer(0.1),
    }


def _transmission(random: np.random.Generator) -> Floats:
    views, rows, bins = _SHAPE
    angle = np.arange(views)[:, None, None] * np.pi / views
    row, s = np.arange(rows)[:, None], np.arange(bins) - (bins - 1) / 2
    integrals = 0.008 * 2 * np.sqrt(np.maximum((0.42 * bins) ** 2 - s**2, 0)) + np.zeros(_SHAPE)
    for _ in range(60):
        x, y, z = *random.uniform(-0.28, 0.28, 2) * bins, random.uniform(0, rows)
        t, radius = s - x * np.cos(angle) - y * np.sin(angle), random.uniform(2, 12)
        integrals += 0.02 * 2 * np.sqrt(np.maximum(radius**2 - t**2 - (row - z) ** 2, 0))
    return np.exp(-integrals)


def _seconds(method: Callable[[Floats], Floats], stack: Floats) -> float:
    spent = []
    for _ in range(3):
        start = time.process_time()
        method(stack)
        spent.append(time.process_time() - start)
    return float(np.median(spent))


if __name__ == "__main__":
    main(tyro.cli(Options))
