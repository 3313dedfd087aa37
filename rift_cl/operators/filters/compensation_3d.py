"""Density compensation for directions in space: what each view of a volume stands for.

Two kinds of views sample a volume's spectrum: a projection along a direction n has the plane
through zero across n (electron microscopy of single particles, laminography), and a set of plane
integrals has the line along its normal (``rift_cl/operators/filters/compensation.py`` explains the
principle, in the plane). Their filters are shares of the whole times a ramp:

- planes: H_j(k) = 2 |k| share_j(k), shares up to 1 in all, since evenly spread planes have the
  density 1 / (2 |k|);
- lines: H_j(k) = k^2 share_j(k), shares in steradians, up to 2 pi in all.

``capped-voronoi`` takes the part of the sphere that is nearest to a direction, capped at what an
object of diameter D lets a view know: a slab 1 / D thick about a plane, 1 / (2 D |k|) of the whole,
and a square (1 / D)^2 across a line; never below the mean part. ``exact`` divides by the overlap of
those slabs, sum_i max(0, 1 - D |n_i . k|), so that the share of a plane varies along the ring of
frequencies k (Harauz and van Heel 1986; Radermacher 1988), or by that of cones about lines.
``pipe-menon`` levels the overlap by iteration, ring by ring. At each frequency the last two are
scaled to the total of the first, which makes zero frequency, and the level, right.

Pure functions in NumPy; the overlaps of n views cost n^2 for each frequency.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.operators.filters.compensation import COMPENSATIONS, LEVEL, MOST_STEPS
from rift_cl.operators.filters.directions_3d import Lines

Floats = NDArray[np.float64]
# Numbers that are held at a time where every view meets every other.
_BLOCK = 1 << 22
# Points along a ring, and planes, that the mean over all rings is taken from.
_RING, _PLANES = 48, 128


def radial_lines(
    directions: ArrayLike, frequencies: ArrayLike, diameter: float, kind: str = "capped-voronoi"
) -> Floats:
    """Shares of views that sample lines through zero.

    Args:
        directions: (views, 3) along the lines, of any length but zero.
        frequencies: (n,) along the line, in cycles per unit of length.
        diameter: of the object, in that unit.
        kind: ``capped-voronoi``, ``pipe-menon`` or ``exact``.

    Returns:
        (views, n) steradians.

    Raises:
        ShapeError: directions or frequencies have another shape.
        InputError: the kind is unknown, the diameter no length, or a number not finite.
    """
    lines, k = Lines.of(directions), _frequencies(frequencies, 1)
    steepness = _length(diameter) * np.abs(k)
    capped = _capped_areas(lines, 1 / np.maximum(steepness, 1e-150) ** 2)
    return lines.share(_levelled(lines, steepness, capped, kind, _cone))


def central_planes(
    axes: ArrayLike, frequencies: ArrayLike, diameter: float, kind: str = "capped-voronoi"
) -> Floats:
    """Shares of views that sample planes through zero.

    Args:
        axes: (views, 2, 3) directions in space of the detector's two axes: unit vectors at right
            angles; the view looks along their cross product.
        frequencies: (n, 2) along these, in cycles per unit of length.
        diameter: of the object, in that unit.
        kind: ``capped-voronoi``, ``pipe-menon`` or ``exact``.

    Returns:
        (views, n) parts of the whole.

    Raises:
        ShapeError: axes or frequencies have another shape.
        InputError: axes are no such vectors, the kind is unknown, the diameter no length, or a
            number not finite.
    """
    frames, k = _frames(axes), _frequencies(frequencies, 2)
    normals = np.cross(frames[:, 0], frames[:, 1])
    lines = Lines.of(normals)
    radii = np.linalg.norm(k, axis=1)
    steepness = _length(diameter) * radii
    capped = _capped_areas(lines, np.pi / np.maximum(steepness, 1e-300)) / (2 * np.pi)
    if kind != "exact":
        return lines.share(_levelled(lines, steepness, capped, kind, _slab_on_ring))
    # Repeated views overlap with each other, and so share alike by themselves.
    shares: Floats = 1 / _slabs(normals, np.einsum("nd,jdx->jnx", k, frames), diameter)
    shares *= capped.sum(0) / _mean_over_rings(normals, frames, radii, diameter)
    return shares


def _levelled(
    lines: Lines,
    steepness: Floats,
    capped: Floats,
    kind: str,
    kernel: Callable[[Floats], Floats],
) -> Floats:
    """Shares by the overlaps of all lines at each frequency, (n, frequencies)."""
    if kind not in COMPENSATIONS:
        names = ", ".join(map(repr, COMPENSATIONS))
        raise InputError(f"kind is {kind!r}, wanted one of {names}")
    if kind == "capped-voronoi":
        return capped
    shares = np.empty_like(capped)
    for index, steep in enumerate(steepness):
        found = np.ones(len(lines))
        for _ in range(MOST_STEPS if kind == "pipe-menon" else 1):
            covered = _overlap(lines.vectors, found, float(steep), kernel)
            covered /= covered.mean()
            found = found / covered
            if np.abs(covered - 1).max() <= LEVEL:
                break
        shares[:, index] = found * (capped[:, index].sum() / found.sum())
    return shares


def _overlap(
    vectors: Floats, weights: Floats, steepness: float, kernel: Callable[[Floats], Floats]
) -> Floats:
    """The weighted sum of a kernel of D k sin(angle) over all lines, about each of them."""
    sums = np.empty(len(vectors))
    run = max(1, _BLOCK // len(vectors))
    for first in range(0, len(vectors), run):
        part = slice(first, first + run)
        cosines = np.minimum(np.abs(vectors[part] @ vectors.T), 1)
        sums[part] = kernel(steepness * np.sqrt((1 - cosines) * (1 + cosines))) @ weights
    return sums


def _slabs(normals: Floats, points: Floats, diameter: float) -> Floats:
    """The overlap of all slabs at points of each view, (views, n, 3): (views, n)."""
    sums = np.empty(points.shape[:2])
    flat, out = points.reshape(-1, 3), sums.reshape(-1)
    run = max(1, _BLOCK // len(normals))
    for first in range(0, len(flat), run):
        distances = diameter * np.abs(flat[first : first + run] @ normals.T)
        out[first : first + run] = np.maximum(0, 1 - distances).sum(1)
    # Every plane holds its own points, whatever rounding says.
    return np.maximum(sums, 1)


def _mean_over_rings(normals: Floats, frames: Floats, radii: Floats, diameter: float) -> Floats:
    """The sum over views of one over the overlap, its mean over rings of each radius."""
    some = frames[np.unique(np.linspace(0, len(frames) - 1, _PLANES).astype(int))]
    angles = (np.arange(_RING) + 0.5) * np.pi / _RING
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ring = np.einsum("nd,jdx->jnx", circle, some)
    distinct, place = np.unique(radii, return_inverse=True)
    means = [float((1 / _slabs(normals, r * ring, diameter)).mean()) for r in distinct]
    total: Floats = len(frames) * np.array(means)[place.ravel()]
    return total


def _capped_areas(lines: Lines, cap: Floats) -> Floats:
    """Areas of the half-sphere, capped, but never below the mean one, (n, frequencies)."""
    floor = np.maximum(cap, 2 * np.pi / len(lines))
    areas: Floats = np.minimum(lines.areas[:, None], floor)
    return areas


def _cone(distances: Floats) -> Floats:
    return np.maximum(0, 1 - distances)


def _slab_on_ring(distances: Floats) -> Floats:
    """The mean of max(0, 1 - s |cos phi|) over a ring that rises to s slabs above a plane."""
    inverse = 1 / np.maximum(distances, 1)
    steep = np.arcsin(inverse) - (1 - np.sqrt(1 - inverse**2)) * np.maximum(distances, 1)
    means: Floats = np.where(distances <= 1, 1 - 2 / np.pi * distances, 2 / np.pi * steep)
    return means


def _frames(axes: ArrayLike) -> Floats:
    frames = real_numbers(axes)
    if frames is None or frames.ndim != 3 or frames.shape[1:] != (2, 3) or not len(frames):
        raise ShapeError("axes: wanted (views, 2, 3) real numbers, two unit vectors for each view")
    products = np.einsum("jdx,jex->jde", frames, frames)
    if not np.isfinite(frames).all():
        raise NonFiniteError("axes holds NaN or infinity, wanted finite unit vectors")
    if not np.allclose(products, np.eye(2), atol=1e-6):
        raise InputError("axes: wanted unit vectors at right angles to each other")
    return frames


def _frequencies(values: ArrayLike, axes: int) -> Floats:
    k = real_numbers(values)
    if k is None or k.ndim != axes or (axes == 2 and k.shape[1] != 2):
        raise ShapeError(f"frequencies: wanted real numbers, {'(n, 2)' if axes == 2 else '(n,)'}")
    if not np.isfinite(k).all():
        raise NonFiniteError("frequencies holds NaN or infinity")
    return k


def _length(diameter: float) -> float:
    if not 0 < one_number(diameter) < np.inf:
        raise InputError(f"diameter is {diameter!r}, wanted the object's, a positive length")
    return float(diameter)
