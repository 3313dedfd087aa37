"""PyLops' operators as ours, and ours as PyLops'.

    from rift_cl.interop.pylops import from_pylops, to_pylops

    P = to_pylops(A)                     # P.dims, P.dimsd are A.domain, A.range
    x = pylops.optimization.basic.cgls(P, y, niter=20)[0]
    D = from_pylops(pylops.Gradient(A.domain, dtype=A.dtype), device=A.device)
    K = rift_cl.vstack(A, D)             # operators that are combined have one type

Numbers are on the host on PyLops' side. What it computes of a float32 operator is good to 7 digits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.real_type import working_type
from rift_cl.errors import DTypeError, ShapeError
from rift_cl.interop.optional_package import optional_package
from rift_cl.interop.scipy import aslinearoperator
from rift_cl.operators.host_operator import HostOperator
from rift_cl.operators.linear import LinearOperator

__all__ = ["from_pylops", "to_pylops"]

# In what NumPy says where SciPy and PyLops make a vector of their length of what a function gave.
_LENGTH = "cannot reshape array of size"


def to_pylops(A: LinearOperator) -> Any:
    """An operator as a ``pylops.LinearOperator`` with the same shapes.

    Raises:
        DTypeError: A is no operator of this package.
        InputError: PyLops is not installed.
    """
    flat = aslinearoperator(A)
    return optional_package("pylops", what="to_pylops").aslinearoperator(flat)


def from_pylops(P: Any, *, device: Device | None = None) -> LinearOperator:
    """An operator of PyLops, or of SciPy, as one of ours; it computes on the host.

    Args:
        P: a real operator with ``shape``, ``dtype``, ``matvec`` and ``rmatvec``; ``dims`` and
            ``dimsd``, where it has them, are the shapes of domain and range. A sparse or dense
            matrix becomes one by ``scipy.sparse.linalg.aslinearoperator``. Where SciPy was given no
            ``rmatvec``, a ``DTypeError`` says so when the adjoint is applied.
        device: whose arrays the result takes as well; the default one if not given.

    Returns:
        An operator in float64 where P is, and in float32 otherwise.

    Raises:
        DTypeError: P is no such operator, or complex.
        ShapeError: P gave a vector of another length than its shape tells, when it was applied.
    """
    missing = [n for n in ("shape", "dtype", "matvec", "rmatvec") if not hasattr(P, n)]
    if missing:
        raise DTypeError(
            f"P is a {type(P).__name__} without {missing[0]}, wanted an operator of PyLops or "
            "SciPy (scipy.sparse.linalg.aslinearoperator makes one of a matrix)"
        )
    rows, columns = P.shape
    return HostOperator(
        lambda x: _product(P, "matvec", x.ravel(), rows),
        lambda y: _product(P, "rmatvec", y.ravel(), columns),
        _shape(P, "dims", columns),
        _shape(P, "dimsd", rows),
        dtype=working_type(np.float32 if P.dtype is None else P.dtype, name="P"),
        device=device,
    )


def _product(P: Any, name: str, x: NDArray[Any], length: int) -> Any:
    """``P x`` by ``matvec``, or ``P' x`` by ``rmatvec``, of so many numbers.

    SciPy tells of a function that it was not given, and of one that gives another length, only when
    it wants it.
    """
    try:
        return getattr(P, name)(x)
    except ValueError as error:
        if _LENGTH not in str(error) or f"({length},)" not in str(error):
            raise
        raise ShapeError(
            f"{name} of P, a {type(P).__name__} of shape {P.shape}, does not give a vector of "
            f"length {length} ({error})"
        ) from error
    except NotImplementedError as error:
        raise DTypeError(
            f"P is a {type(P).__name__} without an adjoint ({error}), which A.T and solvers need: "
            "make it with rmatvec="
        ) from error


def _shape(P: Any, name: str, count: int) -> tuple[int, ...]:
    shape = tuple(int(n) for n in getattr(P, name, ()))
    return shape if math.prod(shape) == count and shape else (count,)
