"""How a point of the detector is spread over the bins: the hat function, written out as a matrix.

A hat of half-width h about a position p gives bin b the weight ``max(0, 1 - |p - b| / h)``. With
h = 1 that is linear interpolation between the two bins about p. Weights over all bins of an
endless detector add up to h when h is a whole number, and nearly so when it is not.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse


def hat_matrix(positions: NDArray[np.float64], half_width: float, bins: int) -> Any:
    """The weights of all bins for all positions.

    Args:
        positions: (n,) fractional bin numbers, inside the detector or not.
        half_width: of the hat, in bins, at least 1.
        bins: number of bins; what falls outside them is lost.

    Returns:
        Sparse (n, bins) float64 matrix.
    """
    reached = int(np.ceil(2 * half_width)) + 1
    nearest = np.ceil(positions - half_width).astype(np.int64)[:, None] + np.arange(reached)
    weights = np.maximum(0.0, 1 - np.abs(positions[:, None] - nearest) / half_width)
    seen = (weights > 0) & (nearest >= 0) & (nearest < bins)
    entry, _ = np.nonzero(seen)
    shape = (len(positions), bins)
    return sparse.csr_matrix((weights[seen], (entry, nearest[seen])), shape=shape)
