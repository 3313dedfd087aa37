"""How the data of a scan change as source and detector move: for alignment view by view.

A pixel's value is a line integral from source to pixel. As the pixel moves alone, the ray meets the
upright detector elsewhere, and the value changes by the slopes of the upright view there. As source
and pixel move together, rays see the volume displaced, so that the value changes by the integral of
the volume's gradient; what the source does alone is the difference of the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.host_arrays import as_host_array
from rift_cl.errors import InputError
from rift_cl.operators.projector.cone.vector_projector import VectorProjector

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GeometryGradient:
    """Derivatives of a number by the places of source and detector, as ``Vectors`` has them.

    Args:
        source: by the source's place, (views, 3), as (x, y, z).
        middle: by the place of the detector's centre, (views, 3).
        across: by the step from bin to bin, (views, 3).
        down: by the step from row to row, (views, 3).
    """

    source: Floats
    middle: Floats
    across: Floats
    down: Floats


def geometry_gradient(A: VectorProjector, x: ArrayLike, weights: ArrayLike) -> GeometryGradient:
    """The gradient of ``sum(weights * A(x))`` by the geometry of ``A``.

    With weights ``A(x) - y`` it is that of half the squared residual. Derivatives are those of line
    integrals of the volume, as true as ``A`` measures these. It takes four projections.

    Args:
        A: ``rift.Projector(grid, scan)`` of a ``Vectors`` scan.
        x: the volume, of shape ``A.domain``, on the host.
        weights: of shape ``A.range``, on the host.

    Raises:
        InputError: ``A`` is of another scan, or an array has another shape or is not finite.
    """
    if not isinstance(A, VectorProjector):
        raise InputError(
            f"A is a {type(A).__name__}, wanted the projector of a Vectors scan; a flat Cone gives "
            "its by Cone.vectors()"
        )
    volume = as_host_array(x, A.domain, name="x", wants="the operator", dtype=A.dtype)
    given = as_host_array(weights, A.range, name="weights", wants="the operator", dtype=A.dtype)
    _, slopes = A.slopes(volume)
    weighted = slopes * given.astype(np.float64)
    k, i = (np.arange(n) - (n - 1) / 2 for n in (A.scan.bins, A.scan.rows))
    middle = weighted.sum(axis=(2, 3)).T
    across = (weighted.sum(axis=2) @ k).T
    down = (weighted.sum(axis=3) @ i).T
    together = np.stack([_sums(given, A(change)) for change in _changes(volume, A)], axis=1)
    return GeometryGradient(together - middle, middle, across, down)


def _changes(volume: NDArray[Any], A: VectorProjector) -> list[NDArray[Any]]:
    """Derivatives of a volume by x, y and z, zero beyond its ends."""
    found = []
    for axis in (2, 1, 0):
        padded = np.pad(volume, [(1, 1) if n == axis else (0, 0) for n in range(3)])
        ahead, behind = (
            np.take(padded, np.arange(volume.shape[axis]) + step, axis=axis) for step in (2, 0)
        )
        found.append((ahead - behind) / (2 * A.grid.spacing[axis]))
    return found


def _sums(weights: NDArray[Any], data: NDArray[Any]) -> Floats:
    sums: Floats = np.einsum("nij,nij->n", weights, data, dtype=np.float64)
    return sums
