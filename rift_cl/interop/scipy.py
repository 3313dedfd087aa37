"""SciPy's view of an operator, so that its solvers, and PyLops', work on any OpenCL device.

    from scipy.sparse.linalg import lsqr
    from rift_cl.interop.scipy import aslinearoperator

    image = lsqr(aslinearoperator(A), sinogram.ravel(), iter_lim=30)[0].reshape(A.domain)

``pylops.aslinearoperator`` takes the result as it is. Vectors are images and sinograms laid out
row by row (C order).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator as ScipyOperator

from rift_cl.errors import DTypeError
from rift_cl.operators.linear import LinearOperator

__all__ = ["FlatOperator", "aslinearoperator"]


def aslinearoperator(A: LinearOperator) -> FlatOperator:
    """An operator as SciPy knows them.

    Args:
        A: a projector, its adjoint, ``FilteredBackprojection``, any sum or product.

    Returns:
        The operator from vectors of ``prod(A.domain)`` to vectors of ``prod(A.range)``, of type
        ``A.dtype``. What it gives has the type that a matrix of that type would give, but is
        computed in ``A.dtype``: a float32 operator in a float64 solver is good to 7 digits.

    Raises:
        DTypeError: A is no operator of this package.
    """
    if not isinstance(A, LinearOperator):
        raise DTypeError(f"A is a {type(A).__name__}, wanted a linear operator of rift_cl")
    return FlatOperator(A)


class FlatOperator(ScipyOperator):  # type: ignore[misc]
    """A linear operator between vectors.

    Args:
        A: the operator between arrays.

    ``dims`` and ``dimsd`` are the shapes of its domain and range, under PyLops' names.

    Raises, when it is applied:
        InputError: a vector holds complex numbers, NaN or infinity.
    """

    def __init__(self, A: LinearOperator) -> None:
        super().__init__(A.dtype, (math.prod(A.range), math.prod(A.domain)))
        self.A = A
        self.dims, self.dimsd = A.domain, A.range

    def _matvec(self, x: NDArray[Any]) -> NDArray[Any]:
        flat: NDArray[Any] = self.A(np.reshape(x, self.dims)).ravel()
        # As of a matrix: solvers in float64 do their own sums in the type that comes back.
        return flat.astype(np.result_type(x, self.dtype), copy=False)

    def _rmatvec(self, x: NDArray[Any]) -> NDArray[Any]:
        return self._adjoint()._matvec(x)

    def _matmat(self, X: NDArray[Any]) -> NDArray[Any]:
        columns = np.empty((self.shape[0], X.shape[1]), np.result_type(X, self.dtype))
        for k, column in enumerate(X.T):
            columns[:, k] = self._matvec(column)
        return columns

    def _rmatmat(self, X: NDArray[Any]) -> NDArray[Any]:
        return self._adjoint()._matmat(X)

    def _adjoint(self) -> FlatOperator:
        return FlatOperator(self.A.T)

    # The numbers are real.
    _transpose = _adjoint
