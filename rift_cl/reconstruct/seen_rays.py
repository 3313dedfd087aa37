"""A projector of which only some rays were measured.

Solvers explain rays one by one, so that views need not be whole: rays that were not measured are
zero in what the operator gives and in the data, and pull at nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.cl.elementwise import copy, multiply
from rift_cl.errors import DTypeError, ShapeError
from rift_cl.operators.linear import LinearOperator
from rift_cl.operators.parallel_projector import ParallelProjector


class SeenRays(LinearOperator):
    """A projector whose unseen rays are zero.

    Args:
        A: the projector of one slice.
        seen: (angle, bin) whether a ray was measured.

    Raises:
        ShapeError: the rays are not those of the projector.
        DTypeError: they are not booleans.
    """

    def __init__(self, A: ParallelProjector, seen: ArrayLike) -> None:
        mask = np.asarray(seen)
        if mask.shape != A.range:
            raise ShapeError(f"seen has shape {mask.shape}, wanted the projector's {A.range}")
        if mask.dtype != np.bool_:
            raise DTypeError(f"seen holds {mask.dtype}, wanted booleans: compare it with a number")
        super().__init__(A.domain, A.range, A.device, A.dtype)
        self.grid, self.scan = A.grid, A.scan
        self._A, self._seen = A, A.device.array(mask, A.dtype)

    @property
    def scratch(self) -> int:
        """The projector's, and a sinogram to mask."""
        return self._A.scratch + 2 * int(self._seen.nbytes)

    def _apply(self, x: Any, out: Any) -> None:
        self._A._apply(x, out)
        multiply(self.device, self._seen, out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        masked = self.device.empty(y.shape, self.dtype)
        copy(self.device, y, masked)
        multiply(self.device, self._seen, masked)
        self._A._apply_adjoint(masked, out)
