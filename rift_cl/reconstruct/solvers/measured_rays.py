"""A projector of which only some rays were measured.

Solvers explain rays one by one, so that views need not be whole: rays that were not measured are
zero in what the operator gives and in the data, and pull at nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import DTypeError, ShapeError
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays


class MeasuredRays(WeightedRays):
    """A projector whose unseen rays are zero: weights that are 0 or 1.

    Args:
        A: the projector.
        seen: of its range's shape, whether a ray was measured.

    Raises:
        ShapeError: the rays are not those of the projector.
        DTypeError: they are not booleans.
    """

    def __init__(self, A: LinearOperator, seen: ArrayLike) -> None:
        mask = np.asarray(seen)
        if mask.shape != A.range:
            raise ShapeError(f"seen has shape {mask.shape}, wanted the projector's {A.range}")
        if mask.dtype != np.bool_:
            raise DTypeError(f"seen holds {mask.dtype}, wanted booleans: compare it with a number")
        super().__init__(A, mask)

    def __reduce__(self) -> tuple[Any, ...]:
        return MeasuredRays, (self.inner, self.weights > 0)
