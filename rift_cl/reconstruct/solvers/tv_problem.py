"""Least squares with total variation, the problem that FISTA and PDHG both solve.

    minimise  |F^(1/2) (A x - y)|^2 / 2 + weight * TV(x),    x >= 0 if asked for.

The data term is a sum over the samples of y, the variation an integral over the image (see
``tv_functional``), so that the weight has the unit of y squared over the unit of TV: for an image
in u and lengths in mm, y is in u mm, TV in u mm, and the weight in u mm; for a volume TV is in
u mm^2 and the weight in u. It does not depend on how fine the grid is, but for twice the views the
data term is twice as large, and so is the weight that does the same. Where rays have weights, TV
counts times their mean, so that only their ratios matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from rift_cl.cl.elementwise import clip_negative
from rift_cl.cl.reductions import dot
from rift_cl.errors import InputError, NonFiniteError, checked_flag
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.solver import Solver, SolverState
from rift_cl.reconstruct.solvers.tv_functional import TotalVariation

# How far from the ends of a type's range values stay whose squares, beside weights and lengths,
# are to be told from 0 and infinity.
_CLEAR_OF_ENDS = 1e3


@dataclass
class VariationState(SolverState):
    """What both methods keep.

    Args:
        weighted: F times the residual; None where there is no F.
        dual: a vector at every sample, the dual of the variation.
        objective: what is minimised, at the image.
    """

    weighted: Any
    dual: Any
    objective: float


class VariationSolver(Solver):
    """A method for this problem; arguments and errors are those of ``tv``."""

    _now: VariationState

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        weight: float,
        *,
        nonnegative: bool = False,
        precondition: Precondition = None,
        noise: float | None = None,
        weights: Any = None,
        direction_weights: DirectionWeights | None = None,
    ) -> None:
        if not one_number(weight) >= 0:
            raise InputError(f"weight is {weight!r}, wanted a number, 0 or more")
        self._nonnegative = checked_flag("tv", "nonnegative", nonnegative)
        data = DataTerm(A, y, precondition, noise, self.arrays, weights)
        super().__init__(data, noise)
        self._weight = float(weight)
        # What the variation counts beside data of these weights, whatever their scale.
        self._strength = self._weight * data.mean_weight
        spacing = (1.0,) * len(A.domain) if A.grid is None else A.grid.spacing
        self.variation = TotalVariation(data.home, A.domain, spacing, direction_weights)
        self._largest = data.norm_squared() or 1.0
        self._check_range()

    def _check_range(self) -> None:
        """Make sure that squares of the data and of the image they tell of have room in the type.

        Gradients of the image are squared to be shortened: of squares that are 0 or infinite
        another image follows, which looks like one.

        Raises:
            NonFiniteError: they have none.
        """
        data, limits = self.data, np.finfo(self.data.dtype)
        least = sqrt(float(limits.tiny)) * _CLEAR_OF_ENDS
        most = sqrt(float(limits.max)) / _CLEAR_OF_ENDS
        measured = data.rms(data.y)
        pixels = max(int(np.prod(data.A.domain)), 1)
        pictured = measured * sqrt(data.samples / pixels / self._largest)
        for what, size in (("y holds", measured), ("the image holds", pictured)):
            if size and not least < size < most:
                raise NonFiniteError(
                    f"{what} values of about {size:.1g}, whose squares leave the range of "
                    f"{data.dtype}: scale y, the weight and lengths such that values are near 1"
                )

    @property
    def weight(self) -> float:
        """Weight of the total variation."""
        return self._weight

    def _begin(self, start: Any) -> dict[str, Any]:
        """What both methods keep, for the image to begin from."""
        data = self.data
        image, residual = data.start(start), data.data()
        self._constrain(image)
        data.residual(image, residual)
        weighted = None if data.weight is None else data.data()
        if weighted is not None:
            data.weigh(residual, weighted)
        dual = data.home.zeros(self.variation.field_shape)
        objective = self._objective(image, residual, weighted)
        rms = data.rms(residual)
        return vars(VariationState(image, residual, 0, rms, weighted, dual, objective))

    def _constrain(self, image: Any) -> None:
        """Bring an image to the nearest one that is allowed, in place."""
        if self._nonnegative:
            clip_negative(self.data.device, image)

    def _objective(self, image: Any, residual: Any, weighted: Any) -> float:
        square = dot(self.data.device, residual, residual if weighted is None else weighted)
        return square / 2 + self._strength * self.variation.value(image)

    def _figures(self) -> dict[str, float]:
        return {"objective": self._now.objective}
