"""Splats at the samples of a grid: the twin of ``hermite_dilate.cl`` and ``hermite_voxelise.cl``.

From the definitions and in float64: covariances are formed as matrices and factored from below by
Cholesky, modes are tensors with an index for each order, and every splat meets every sample.
(Modes under a linear map and under convolution with a Gaussian: they are its derivatives, see
Refregier 2003 for the one-dimensional case.)
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement, islice
from math import factorial, prod, sqrt

import numpy as np
from numpy.polynomial import hermite_e
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from rift_cl.geometry import Grid

Floats = NDArray[np.float64]


def voxelise(
    means: Floats,
    quats: Floats,
    scales: Floats,
    amplitudes: Floats,
    grid: Grid,
    *,
    shape_modes: Floats | None = None,
    dilation: float | Floats = 0.0,
    reach: float = np.inf,
) -> Floats:
    """The sum of N splats at the samples of a grid.

    Args:
        means: (N, 3) positions (x, y, z) in the grid's unit.
        quats: (N, 4) rotations (w, x, y, z) of any length.
        scales: (N, 3) standard deviations along the rotated axes.
        amplitudes: (N,) what multiplies a splat whose modes are zero, at its mean.
        grid: (nz, ny, nx).
        shape_modes: (N, K - 1) coefficients of normalised modes, graded, without the constant.
        dilation: variance that every splat gains along (x, y, z), while its mass stays.
        reach: standard deviations at which splats end.

    Returns:
        (nz, ny, nx).
    """
    turns = Rotation.from_quat(np.roll(np.asarray(quats, float), -1, axis=1)).as_matrix()
    roots = turns * np.asarray(scales, float)[:, None, :]
    axes = np.meshgrid(*(grid.coordinates(axis) for axis in (0, 1, 2)), indexing="ij")
    samples = np.stack(axes[::-1], axis=-1)
    total = np.zeros(grid.shape)
    for number, (mean, root) in enumerate(zip(means, roots, strict=True)):
        wide = np.linalg.cholesky(root @ root.T + np.eye(3) * dilation)
        factor = abs(np.linalg.det(root)) / np.linalg.det(wide)
        u = (samples - mean) @ np.linalg.inv(wide).T
        modes = np.zeros(0) if shape_modes is None else shape_modes[number]
        density = _polynomial(modes, np.linalg.solve(wide, root), u) * _bell(u, reach)
        total += amplitudes[number] * factor * density
    return total


def edge(order: int) -> float:
    """Standard deviations beyond which no mode up to an order has more than exp(-8).

    exp(-8) of its peak is what a Gaussian has where the rasterizer ends its line integrals, at 4.
    """

    def excess(x: float) -> float:
        mode = hermite_e.hermeval(x, [0] * order + [1]) / sqrt(factorial(order))
        return float(np.log(abs(mode)) - x**2 / 2 + 8)

    # The outermost zero lies before sqrt(4 n + 2); behind it a mode rises once and falls.
    top = sqrt(order) + 2
    return float(brentq(excess, top, 8))


def graded_tensors(modes: Floats) -> Iterator[Floats]:
    """The modes behind the constant, order by order, as tensors with an index for each derivative.

    Mode (a, b, c) is the a-th derivative by x, the b-th by y, the c-th by z. It stands at one of
    its places, (0,) * a + (1,) * b + (2,) * c, which in graded order come as numbers do.
    """
    order, first = 1, 0
    while first < len(modes):
        tensor = np.zeros((3,) * order)
        for place in islice(combinations_with_replacement(range(3), order), len(modes) - first):
            orders = np.bincount(place, minlength=3)
            tensor[place] = modes[first] / sqrt(prod(factorial(int(n)) for n in orders))
            first += 1
        yield tensor
        order += 1


def _polynomial(modes: Floats, to_unit: Floats, u: Floats) -> Floats:
    """1 + sum of modes, which belong to x', at places u = A x' of a dilated splat."""
    total = np.ones(u.shape[:-1])
    for given in graded_tensors(modes):
        tensor = given
        # Derivatives by x' as derivatives by u: d/dx'_i = sum over a of A_ai d/du_a.
        for slot in range(given.ndim):
            tensor = np.moveaxis(np.tensordot(to_unit, tensor, axes=(1, slot)), 0, slot)
        alike: dict[tuple[int, ...], float] = {}
        for place, share in np.ndenumerate(tensor):
            orders = tuple(place.count(axis) for axis in range(3))
            alike[orders] = alike.get(orders, 0.0) + float(share)
        for orders, coefficient in alike.items():
            total += coefficient * _hermite(orders, u)
    return total


def _hermite(orders: tuple[int, ...], u: Floats) -> Floats:
    """The product of He_n over the three dimensions."""
    product = np.ones(u.shape[:-1])
    for axis, order in enumerate(orders):
        product *= hermite_e.hermeval(u[..., axis], [0] * order + [1])
    return product


def _bell(u: Floats, reach: float) -> Floats:
    square = (u**2).sum(axis=-1)
    return np.asarray(np.where(square <= reach**2, np.exp(-0.5 * square), 0))
