"""Coverage on a regular cube of frequencies, for pictures and for tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.sampling.coverage.device import coverage
from rift_cl.sampling.coverage.work import Views
from rift_cl.sampling.targets.target import Target


def coverage_cube(
    views: Views,
    target: Target,
    count: int = 64,
    *,
    weights: ArrayLike | None = None,
    device: Device | None = None,
) -> NDArray[np.float32]:
    """Coverage on a cube of frequencies about zero, (P, count, count, count) along z, y, x.

    Half of it is computed, since coverage at -k is that at k.

    Args:
        views: as given to ``coverage``, as are the rest but one.
        target: its points, diameter and band, which is half the cube's edge.
        count: frequencies along each edge; see ``cube_axis``.
        weights: (V,) relative photons of cameras.
        device: where to compute.

    Raises:
        ShapeError: there is no view.
        InputError: a number is not finite or out of its range, or ``count`` below 2.
    """
    along = cube_axis(target.highest, count)
    count = len(along)
    half = along[: -(-count // 2)]
    z, y, x = np.meshgrid(half, along, along, indexing="ij")
    k = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    found = coverage(views, target, k, weights=weights, device=device)
    cube = np.empty((len(found), count, count, count), np.float32)
    cube[:, : len(half)] = found.reshape(len(found), len(half), count, count)
    cube[:, len(half) :] = cube[:, : count // 2][:, ::-1, ::-1, ::-1]
    return cube


def cube_axis(band: float, count: int) -> NDArray[np.float64]:
    """The frequencies along an edge of a cube: ``count`` from -band to band.

    Raises:
        InputError: ``count`` is no whole number, or below 2.
    """
    if not one_number(count) >= 2 or count != int(count):
        raise InputError(f"count is {count!r}, wanted 2 or more frequencies along an edge")
    return np.linspace(-band, band, int(count))
