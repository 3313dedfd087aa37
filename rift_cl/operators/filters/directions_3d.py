"""The distinct lines through zero among directions in space, and the part of the sphere of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import real_numbers
from rift_cl.operators.filters.directions import Directions

Floats = NDArray[np.float64]
# Lines closer than this, in radians, are the same; lines this close to one plane lie in it.
_SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Lines:
    """Distinct lines; a direction and its opposite are one.

    Args:
        vectors: (n, 3) unit vectors along them.
        areas: (n,) steradians of the half-sphere that are nearest to each; they add up to 2 pi.
        group: (views,) which of them each view has.
    """

    vectors: Floats
    areas: Floats
    group: NDArray[np.intp]

    @classmethod
    def of(cls, directions: ArrayLike) -> Lines:
        """Find the distinct lines.

        Args:
            directions: (views, 3) vectors of any length but zero.

        Raises:
            ShapeError: there is none, or the array has another shape.
            InputError: they are no finite real numbers, or one is zero.
        """
        values = real_numbers(directions)
        if values is None:
            raise InputError("directions: wanted real numbers")
        if values.ndim != 2 or values.shape[1] != 3 or not len(values):
            raise ShapeError(f"directions has shape {values.shape}, wanted (views, 3)")
        if not np.isfinite(values).all():
            raise NonFiniteError("directions holds NaN or infinity, wanted finite vectors")
        largest = np.abs(values).max(1, keepdims=True)
        if not largest.all():
            raise InputError(f"directions[{int(np.argmin(largest))}] is zero, wanted a direction")
        units = values / largest
        units /= np.linalg.norm(units, axis=1, keepdims=True)
        first, group = _distinct(units)
        return cls(units[first], _areas(units[first]), group)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.vectors)

    def share(self, values: Floats) -> Floats:
        """What is a line's, (n, ...), in equal parts to its views, (views, ...)."""
        counts = np.bincount(self.group).reshape((-1,) + (1,) * (values.ndim - 1))
        parts: Floats = (values / counts)[self.group]
        return parts


def _distinct(units: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The first view of each distinct line, and the line that each view has."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    # What is equal at once goes first: the pairs among a thousand equal ones would be a million.
    rounded = np.rint(units / _SAME)
    _, first, group = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    some = units[first]
    pairs = cKDTree(np.concatenate([some, -some])).query_pairs(_SAME, output_type="ndarray")
    pairs = pairs % len(some)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(some),) * 2)
    _, labels = connected_components(links, directed=False)
    found = labels[group.ravel()]
    _, firsts, found = np.unique(found, return_index=True, return_inverse=True)
    return firsts.astype(np.intp), found.ravel().astype(np.intp)


def _areas(vectors: Floats) -> Floats:
    """Voronoi cells of lines on the half-sphere."""
    from scipy.spatial import SphericalVoronoi

    _, spread, axes = np.linalg.svd(vectors, full_matrices=False)
    if len(vectors) < 3 or spread[2] < _SAME * np.sqrt(len(vectors)):
        # All in one plane: cells are lunes.
        if len(vectors) == 1:
            return np.array([2 * np.pi])
        flat = Directions.of(np.arctan2(vectors @ axes[1], vectors @ axes[0]))
        lunes: Floats = flat.share(flat.gaps + np.roll(flat.gaps, 1))
        return lunes
    both = np.concatenate([vectors, -vectors])
    cells = SphericalVoronoi(both, threshold=_SAME / 10).calculate_areas()
    areas: Floats = cells[: len(vectors)] + cells[len(vectors) :]
    areas *= 2 * np.pi / areas.sum()
    return areas
