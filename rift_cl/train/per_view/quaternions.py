"""Turns by quaternions, on the host."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def rotated(quats: Floats, vectors: Floats) -> Floats:
    """(N, 3) vectors, turned by (N, 4) quaternions of any length but zero."""
    unit = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    w, v = unit[:, :1], unit[:, 1:]
    across = np.cross(v, vectors)
    return np.asarray(vectors + 2 * (w * across + np.cross(v, across)))
