"""Coefficients of additive splats by the normal equations, solved directly.

A few hundred unknowns make a small matrix: all its columns are drawn, many at once, and what is
least in squares with a ridge comes by Cholesky's factors. For thousands, conjugate gradients are
the faster way.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from bases.additive import Floats, Placed


def solved(placed: Placed, targets: Floats, ridge: float, stack: int) -> Floats:
    """The coefficients (N, K, C) of the smallest ``|pictures - targets|^2 + ridge |c|^2``.

    Args:
        placed: the splats.
        targets: (V, height, width, C).
        ridge: weight of the squared coefficients, above 0.
        stack: parts that have nothing to do with each other; see ``Placed.columns``.
    """
    views, channels = len(targets), targets.shape[-1]
    parts = targets.reshape(views, stack, -1, channels).swapaxes(0, 1)
    matrices = np.concatenate(list(placed.columns(stack)), axis=-1)
    found = []
    for drawn, part in zip(matrices, parts.reshape(stack, -1, channels), strict=True):
        # Sums of squares of float32 lose what a small ridge decides.
        matrix = drawn.astype(np.float64)
        normal = matrix.T @ matrix
        normal[np.diag_indices_from(normal)] += ridge
        found.append(cho_solve(cho_factor(normal), matrix.T @ part))
    return np.concatenate(found).reshape(-1, placed.modes.count, channels)
