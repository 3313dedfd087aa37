"""The norm of an operator, which bounds the step lengths of solvers: one's own want it as well."""

from __future__ import annotations

import math

import numpy as np

from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm


def operator_norm(A: LinearOperator) -> float:
    """The largest singular value of an operator, from a little above: 5 % at most.

    So primal-dual steps with ``sigma * tau * operator_norm(K) ** 2 <= 1``, and gradient steps of
    ``1 / operator_norm(A) ** 2``, are safe. By a few rounds of Lanczos' method, each of which
    applies A and its adjoint; the same operator gives the same number.

    Args:
        A: any linear operator, a stack (``vstack``) or a product too.

    Raises:
        InputError: A is no linear operator.
        ResourceLimitError: an image and a sinogram or two fit neither the device nor the host.
    """
    shape = A.range if isinstance(A, LinearOperator) else ()
    dtype = A.dtype if isinstance(A, LinearOperator) else np.float32
    return math.sqrt(DataTerm(A, np.zeros(shape, dtype), None, None).norm_squared())
