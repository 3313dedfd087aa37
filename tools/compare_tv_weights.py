"""What the weight that `--method tv` chooses costs, beside the best of many.

    python tools/compare_tv_weights.py --tooth tooth.h5

Slices whose truth is known: the Shepp-Logan head, a body with many small holes, and a slice of a
real tooth (its filtered backprojection, smoothed, and projected again). Each is measured in several
numbers of views over half a turn and at several levels of noise, and reconstructed with weights in
steps of the root of two; nothing is negative. Printed: PSNR in the disc with the weight that is
chosen, with the best, and what the choice costs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import rift_cl as rift
from rift_cl.metrics import psnr
from rift_cl.reconstruct import fbp, tv, variation_weight

Floats = NDArray[Any]
_LARGEST = 1.5


@dataclass(frozen=True)
class Options:
    """Compare the weights of the total variation.

    Args:
        tooth: tooth.h5 of ``rift samples``; without it the tooth is left out.
        size: samples along a side of a slice.
        views: numbers of views.
        noise: standard deviations of the noise, as shares of the largest line integral; below 0,
            Poisson noise of as many photons in place of it, such as -5000.
        steps: of the solver.
        precondition: of the solver, such as ramp.
        seed: of the holes and of the noise.
    """

    tooth: Path | None = None
    size: int = 96
    views: tuple[int, ...] = (30, 90, 180)
    noise: tuple[float, ...] = (0.0, 0.01, 0.05, -5000)
    steps: int = 200
    precondition: str | None = None
    seed: int = 0


def main(options: Options) -> None:
    """Print the table."""
    random = np.random.default_rng(options.seed)
    print("| slice | views | noise | chosen, dB | best, dB | cost, dB | best / chosen |")
    print("| :-- | --: | --: | --: | --: | --: | --: |")
    costs = []
    for name, views, noise, A, sinogram, truth in _cases(options, random):
        chosen = variation_weight(A, sinogram)
        weights = chosen * 2.0 ** np.arange(-4, 4.5, 0.5)
        found = [_score(A, sinogram, w, truth, options) for w in (chosen, *weights)]
        best = int(np.argmax(found[1:]))
        costs.append(found[1 + best] - found[0])
        level = f"{-noise:g} photons" if noise < 0 else f"{noise:.1%}"
        print(
            f"| {name} | {views} | {level} | {found[0]:.2f} | {found[1 + best]:.2f} "
            f"| {costs[-1]:.2f} | {weights[best] / chosen:g} |",
            flush=True,
        )
    print(f"\nmean cost {np.mean(costs):.2f} dB, greatest {np.max(costs):.2f} dB")


def _score(A: Any, y: Floats, weight: float, truth: Floats, options: Options) -> float:
    image = tv(A, y, weight, options.steps, nonnegative=True, precondition=options.precondition)
    disc = np.hypot(*np.ogrid[-1 : 1 : truth.shape[0] * 1j, -1 : 1 : truth.shape[1] * 1j]) < 1
    return float(psnr(np.asarray(image)[disc], truth[disc], peak=float(truth.max())))


def _cases(options: Options, random: Any) -> Iterator[tuple[str, int, float, Any, Floats, Floats]]:
    grid = rift.Grid((options.size, options.size))
    for name, truth in _truths(options, grid, random):
        for views in options.views:
            angles = np.arange(views) * np.pi / views
            scan = rift.Parallel(angles, bins=int(1.1 * options.size))
            A = rift.Projector(grid, scan)
            ideal = np.asarray(A(truth.astype(np.float32)))
            # The largest line integral is that of a transmission of a fifth or so.
            level = _LARGEST / ideal.max()
            ideal, unit = level * ideal, level * truth
            for noise in options.noise:
                if noise < 0:
                    counts = np.maximum(random.poisson(-noise * np.exp(-ideal)), 1)
                    y = -np.log(counts / -noise)
                else:
                    y = ideal + random.normal(0, noise * ideal.max(), ideal.shape)
                yield name, views, noise, A, y.astype(np.float32), unit


def _truths(options: Options, grid: Any, random: Any) -> Iterator[tuple[str, Floats]]:
    yield "head", np.asarray(rift.phantom.shepp_logan(grid))
    yield "holes", _holes(options.size, random)
    if options.tooth is not None:
        yield "tooth", _tooth(options.tooth, options.size)


def _holes(size: int, random: Any) -> Floats:
    """A disc with some sixty holes, four samples to each sample."""
    y, x = np.mgrid[-1 : 1 : 4 * size * 1j, -1 : 1 : 4 * size * 1j]
    image = (np.hypot(x, y) < 0.9).astype(float)
    for _ in range(60):
        r, a = 0.8 * np.sqrt(random.random()), 2 * np.pi * random.random()
        radius = random.uniform(0.02, 0.08)
        image[np.hypot(x - r * np.cos(a), y - r * np.sin(a)) < radius] = random.uniform(0, 0.7)
    return image.reshape(size, 4, size, 4).mean(axis=(1, 3))


def _tooth(path: Path, size: int) -> Floats:
    """A slice of the tooth without its noise, on the grid of the others."""
    import h5py

    from rift_cl.reconstruct.preprocess import remove_rings

    with h5py.File(path) as file:
        group = file["exchange"]
        white, dark = (group[name][:, 0].mean(0) for name in ("data_white", "data_dark"))
        counts, angles = group["data"][:, 0].astype(float), np.radians(group["theta"][:])
    y = remove_rings(-np.log((counts - dark) / (white - dark))[:, None].astype(np.float32))[:, 0]
    center = rift.find_center(y, angles).center
    grid, scan = rift.Grid((6 * size, 6 * size)), rift.Parallel(angles, y.shape[1], center=center)
    fine = gaussian_filter(np.asarray(fbp(rift.Projector(grid, scan), y)), 2)
    return np.clip(fine.reshape(size, 6, size, 6).mean(axis=(1, 3)), 0, None)


if __name__ == "__main__":
    main(tyro.cli(Options))
