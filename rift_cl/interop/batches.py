"""Operators on batches, as other packages have them: leading dimensions count the items."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.operators.linear import LinearOperator


def apply_to_each(A: LinearOperator, items: NDArray[Any]) -> NDArray[Any]:
    """``A x`` for each x of (..., *A.domain), as (..., *A.range).

    Raises:
        InputError: the numbers are none that the operator takes.
    """
    batch = items.shape[: items.ndim - len(A.domain)]
    results = np.empty((*batch, *A.range), A.dtype)
    for place in np.ndindex(batch):
        A(items[place], out=results[place])
    return results
