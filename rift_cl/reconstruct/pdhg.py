"""PDHG: the primal-dual hybrid gradient of Chambolle and Pock for total variation.

Both terms are written by their duals, p for the data and u for the variation (J. Math. Imaging Vis.
40, 2011; ICCV 2011 for steps that are operators), so that no step has an inner iteration:

    x <- max(0, x - tau (A' p + D' u)),
    p <- (p + sigma F (A x~ - y)) / (1 + sigma),
    u <- u + s D x~, each vector shortened to the weight,        x~ = 2 x_new - x_old.

The weight F of the residual enters as the step ``sigma F`` of p: in that metric the proximal map of
the data term, whose conjugate has the inverse of F, needs no inverse. The steps converge since
``tau (sigma |A' F A| + s |D|^2) <= 1``; each term has half of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import clip_negative
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.residual_weight import Precondition
from rift_cl.reconstruct.variation_problem import VariationSolver, VariationState

# Step of the data's dual, a number without unit. A small one gives momentum, and the worse the
# condition of A the smaller is best: of 0.01 to 1 these did well for strong and weak variation on a
# 96^2 image from 96 views, the first without a weight of the residual and the second with one.
_SIGMA, _WEIGHTED_SIGMA = 0.03, 0.2


@dataclass
class _State(VariationState):
    """What PDHG keeps.

    Args:
        data_dual: the dual of the data term.
    """

    data_dual: Any


class Pdhg(VariationSolver):
    """PDHG that has begun; arguments and errors are those of ``tv``."""

    arrays = 8, 7
    _now: _State

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        weight: float,
        *,
        start: Any = None,
        nonnegative: bool = False,
        precondition: Precondition = None,
        noise: float | None = None,
        weights: Any = None,
    ) -> None:
        super().__init__(
            A,
            y,
            weight,
            nonnegative=nonnegative,
            precondition=precondition,
            noise=noise,
            weights=weights,
        )
        data = self.data
        largest = data.norm_squared() or 1.0
        self._sigma = _SIGMA if data.weight is None else _WEIGHTED_SIGMA
        self._tau = 1 / (2 * self._sigma * largest)
        steepest = self.variation.norm_squared
        self._step = self._sigma * largest / steepest if steepest else 0.0
        dual = data.device.zeros(A.range, data.dtype)
        self._now = _State(**self._begin(start), data_dual=dual)
        self._spare = data.image(), data.data()

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        image, fresh = self._spare
        data.gradient(now.data_dual, image)
        self.variation.add_adjoint(1.0, image, 1.0, now.dual, image)
        axpby(device, 1.0, now.image, -self._tau, image)
        if self._nonnegative:
            clip_negative(device, image)
        # The old image becomes the point ahead, 2 new - old.
        axpby(device, 2.0, image, -1.0, now.image)
        radius = self._weight * self.variation.cell
        self.variation.dual_step(now.dual, now.image, now.dual, step=self._step, radius=radius)
        now.image, image = image, now.image
        fresh = self._measure(fresh)
        # As for the image: the old residual becomes the one ahead.
        axpby(device, 2.0, now.residual if now.weighted is None else now.weighted, -1.0, fresh)
        kept = 1 / (1 + self._sigma)
        axpby(device, self._sigma * kept, fresh, kept, now.data_dual)
        self._spare = image, fresh
        now.rms = data.rms(now.residual)
        now.objective = self._objective(now.image, now.residual, now.weighted)
        now.step += 1

    def _measure(self, fresh: Any) -> Any:
        """The residual of the new image, and its weighted one; gives back the old weighted one."""
        now, data = self._now, self.data
        if now.weighted is None:
            data.residual(now.image, fresh)
            now.residual, fresh = fresh, now.residual
            return fresh
        data.residual(now.image, now.residual)
        data.weigh(now.residual, fresh)
        now.weighted, fresh = fresh, now.weighted
        return fresh
