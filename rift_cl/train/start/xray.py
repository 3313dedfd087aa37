"""Where the splats of an X-ray scan begin: in a first volume, by density and by slope.

Half of the splats are drawn by density and half by its gradient, so that edges get small splats and
what is even gets few large ones. Their densities come out of a few steps of expectation
maximisation (Shepp and Vardi 1982) towards the volume, which keep its mass and are never negative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Grid
from rift_cl.train.start.points import start_splats
from rift_cl.train.xray.voxels import Footprints

# Share of the splats that are drawn by the gradient's magnitude.
_BY_GRADIENT = 0.5
# What is below this share of the largest values is drawn the less the fainter it is: it may be no
# more than noise in air.
_FAINT, _LARGE = 0.1, 0.999
_STEPS = 4
# The smallest density, as a share of the mean one: logarithms want more than zero.
_LEAST = 1e-3
# Of splats in one slice: their standard deviation across it, in slices.
FLAT = 0.5

Floats = NDArray[np.float64]


def density_splats(
    volume: Floats,
    grid: Grid,
    count: int,
    *,
    seed: int,
    dilation: float | Sequence[float],
    size: float = 1.0,
) -> dict[str, NDArray[np.float32]]:
    """Isotropic splats that approximate a volume.

    Args:
        volume: (nz, ny, nx) densities; what is negative counts as zero.
        grid: its samples.
        count: how many splats.
        seed: random seed.
        dilation: variance that splats gain along (x, y, z) where they are drawn, one for all or one
            for each, in the grid's unit squared.
        size: standard deviations, as a share of the gaps between splats.

    Returns:
        Raw values as ``Parameters.of(..., density=True)`` takes them; their colour is one.

    Raises:
        InputError: there is nothing in the volume.
    """
    held = np.maximum(np.asarray(volume, float), 0)
    points = _points(held, grid, count, seed)
    raw = start_splats(points, np.ones((count, 3)), seed=seed)
    raw["log_scales"] += np.float32(np.log(size))
    if grid.shape[0] == 1:
        raw["log_scales"][:, 2] = np.log(FLAT * grid.spacing[0])
    means, quats = raw["means"].astype(float), raw["quats"].astype(float)
    scales = np.exp(raw["log_scales"].astype(float))
    # Voxels as large as most splats tell as much of them as finer ones, and are far fewer.
    held, coarse = _coarser(held, grid, float(np.median(scales[:, 0])))
    wider = np.asarray(dilation) + (np.square(coarse.spacing) - np.square(grid.spacing))[::-1] / 12
    densities = _densities(Footprints(coarse, means, quats, scales, dilation=wider), held)
    raw["logits"] = np.log(densities).astype(np.float32)
    return raw


def _points(held: Floats, grid: Grid, count: int, seed: int) -> Floats:
    """Points (x, y, z), drawn evenly along the order of the samples, each within its voxel."""
    random = np.random.default_rng((seed, 0x0DE5))
    large = np.quantile(held, _LARGE)
    if large <= 0:
        raise InputError("there is no density in the volume to begin with, nothing but air")
    sure = held / (held + _FAINT * large)
    chance = held * sure
    slopes = [np.gradient(held, axis=axis) for axis in range(3) if held.shape[axis] > 1]
    steep = np.sqrt(np.sum(np.square(slopes), axis=0)) * sure
    share = chance / chance.sum()
    if steep.any():
        share = (1 - _BY_GRADIENT) * share + _BY_GRADIENT * steep / steep.sum()
    marks = (np.arange(count) + random.uniform(0, 1, count)) / count
    chosen = np.searchsorted(np.cumsum(share.ravel()), marks).clip(0, share.size - 1)
    places = np.stack(np.unravel_index(chosen, held.shape), axis=-1).astype(float)
    places += np.where(np.array(held.shape) > 1, random.uniform(-0.5, 0.5, places.shape), 0)
    middle = (np.array(held.shape) - 1) / 2
    return np.asarray(((places - middle) * grid.spacing + grid.center)[:, ::-1])


def _coarser(held: Floats, grid: Grid, size: float) -> tuple[Floats, Grid]:
    """Means over blocks of whole voxels, about as long as ``size``; zeros fill the last ones."""
    factors = [int(np.clip(size / d, 1, n)) for n, d in zip(grid.shape, grid.spacing, strict=True)]
    short = [-n % k for n, k in zip(grid.shape, factors, strict=True)]
    padded = np.pad(held, [(0, more) for more in short])
    shape = [n // k for n, k in zip(padded.shape, factors, strict=True)]
    split = [part for pair in zip(shape, factors, strict=True) for part in pair]
    center = np.array(grid.center) + np.array(short) / 2 * grid.spacing
    coarse = Grid(shape, list(np.array(grid.spacing) * factors), list(center))
    return padded.reshape(split).mean(axis=(1, 3, 5)), coarse


def _densities(footprints: Footprints, held: Floats) -> Floats:
    """Densities with which the splats approximate the volume."""
    whole = np.maximum(footprints.inner_products(np.ones_like(held)), 1e-12)
    densities = np.full(len(footprints), held.sum() / whole.sum())
    least = _LEAST * densities[0]
    for _ in range(_STEPS):
        drawn = footprints.sums(densities)
        ratio = np.divide(held, drawn, out=np.zeros_like(held), where=drawn > 1e-6 * drawn.max())
        densities = densities * footprints.inner_products(ratio) / whole
    return np.asarray(np.maximum(densities, least))
