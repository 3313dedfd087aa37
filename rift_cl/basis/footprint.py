"""From a splat and a view to the matrix that projects the splat's coefficients."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis.numbers import numbers
from rift_cl.errors import InputError, ShapeError


class Footprint(NamedTuple):
    """How a splat lies on a screen.

    Args:
        L: (out, out) lower triangle, L L^T the covariance on the screen; u' = L^-1 (u - P mu).
        A: (out, in) what ``project`` takes; A A^T = I, or less with a dilation.
        scale: of line integrals: times the projected function they are the X-ray transform.
    """

    L: NDArray[np.float64]
    A: NDArray[np.float64]
    scale: float


def footprint(root: ArrayLike, P: ArrayLike, dilation: float = 0.0) -> Footprint:
    """Where a splat falls under an affine view, and the A that projects its coefficients.

    With V = P M, L L^T = V V^T + dilation I and A = L^-1 V the splat of coefficients c is on the
    screen the splat of coefficients Gamma(A) c. Its line integrals are ``scale`` times that,
    sqrt(2 pi) |M| / |L| for orthonormal rows of P (the factor that Zha et al., R2-Gaussian,
    arXiv 2405.20693, found missing); splats that have an opacity leave it out.

    Args:
        root: (in, in) M, with M M^T the covariance of the splat, in 3 or 2 dimensions.
        P: (in - 1, in) from the world to the screen, of full rank.
        dilation: variance of a blur on the screen, in its units; the blur keeps the integral.

    Raises:
        InputError: shapes do not fit, a number is not finite, or a matrix is singular.
    """
    root, P = numbers(root, "root"), numbers(P, "P")
    if root.shape not in ((2, 2), (3, 3)) or P.shape != (len(root) - 1, len(root)):
        raise ShapeError(
            f"root and P have shapes {root.shape} and {P.shape}, wanted (3, 3) and (2, 3), or "
            "(2, 2) and (1, 2)"
        )
    if not 0 <= dilation < math.inf:
        raise InputError(f"dilation is {dilation!r}, wanted a variance of at least 0")
    V = P @ root
    try:
        L = np.linalg.cholesky(V @ V.T + dilation * np.eye(len(P)))
    except np.linalg.LinAlgError:
        raise InputError("root or P is singular: the splat has no area on the screen") from None
    across = math.sqrt(np.linalg.det(P @ P.T))
    scale = math.sqrt(2 * math.pi) * abs(np.linalg.det(root)) * across / np.diag(L).prod()
    return Footprint(L, np.linalg.solve(L, V), float(scale))
