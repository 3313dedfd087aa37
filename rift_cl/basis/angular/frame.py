"""Unit vectors and rotated frames with their derivatives: what lobes are measured in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# A quaternion or an axis with no component above this has no direction (as in gaussian.h).
LEAST_LENGTH = 1e-30


class Units(NamedTuple):
    """Unit vectors, and how they change with the vectors that they were made of.

    Args:
        vectors: (..., 3).
        slopes: (..., 3, 3) derivatives of the unit vector (first) by the given one.
    """

    vectors: Floats
    slopes: Floats


class Frames(NamedTuple):
    """Rotations of quaternions with their derivatives.

    Args:
        matrices: (..., 3, 3) whose columns are t, b, a.
        slopes: (..., 3, 3, 4) derivatives by the quaternion (w, x, y, z) as it was given.
    """

    matrices: Floats
    slopes: Floats


def unit_axes(vectors: Floats) -> Units:
    """Vectors of any length made unit; NaN where they have none, or are not finite."""
    even, largest = _even(vectors)
    length = np.sqrt((even**2).sum(-1, keepdims=True))
    unit = even / length
    across = np.eye(3) - unit[..., :, None] * unit[..., None, :]
    return Units(unit, across / (length * largest)[..., None])


def unit_directions(vectors: Floats) -> Units:
    """As ``unit_axes``, but a direction of no length is (0, 0, 1) and does not change."""
    unit, slopes = unit_axes(vectors)
    none = (vectors == 0).all(-1)
    return Units(
        np.where(none[..., None], [0.0, 0.0, 1.0], unit),
        np.where(none[..., None, None], 0.0, slopes),
    )


def frames_of(quats: Floats) -> Frames:
    """Rotations of quaternions (..., 4) of any length; NaN where they have none.

    The matrix is N(q) / |q|^2 with quadratic forms N_ij = q^T T_ij q, hence its derivative
    (2 T_ij q - 2 R_ij q) / |q|^2.
    """
    even, largest = _even(quats)
    square = (even**2).sum(-1)[..., None, None]
    halves = np.einsum("ijab,...b->...ija", _FORMS, even)
    matrices = np.einsum("...ija,...a->...ij", halves, even) / square
    slopes = 2 * (halves - matrices[..., None] * even[..., None, None, :]) / square[..., None]
    return Frames(matrices, slopes / largest[..., None, None])


def quaternion_towards(axes: Floats) -> Floats:
    """Quaternions (..., 4) of the shortest turn from the z axis to unit vectors."""
    x, y, z = np.moveaxis(axes, -1, 0)
    half_way = np.stack([1 + z, -y, x, np.zeros_like(z)], -1)
    length = np.sqrt((half_way**2).sum(-1, keepdims=True))
    opposite = length < 1e-6
    return np.where(opposite, [0.0, 1.0, 0.0, 0.0], half_way / np.where(opposite, 1, length))


def _even(vectors: Floats) -> tuple[Floats, Floats]:
    """Vectors over their largest component, so that squares neither overflow nor vanish."""
    largest = np.abs(vectors).max(-1, keepdims=True)
    usable = np.isfinite(largest) & (largest > LEAST_LENGTH)
    largest = np.where(usable, largest, np.nan)
    return np.where(usable, vectors, np.nan) / largest, largest


def _numerators(q: Floats) -> Floats:
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def _forms() -> Floats:
    """The symmetric T_ij of the numerators: (3, 3, 4, 4), by polarisation."""
    unit = np.eye(4)
    forms = np.empty((3, 3, 4, 4))
    for a in range(4):
        for b in range(4):
            both, one, other = (_numerators(q) for q in (unit[a] + unit[b], unit[a], unit[b]))
            forms[:, :, a, b] = (both - one - other) / 2
    return forms


_FORMS = _forms()
