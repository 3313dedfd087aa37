"""FISTA: accelerated proximal gradient steps for total variation.

Each step goes down the gradient of the data term from a point ahead of the image, then denoises by
total variation (Beck and Teboulle, SIAM J. Imaging Sci. 2, 2009; IEEE Trans. Image Process. 18,
2009). The denoising is a fixed number of steps on its dual, which begins where the last one ended,
so that it gets better as the image settles. The momentum begins anew whenever the objective rises
(O'Donoghue and Candes, Found. Comput. Math. 15, 2015).

The point ahead is a combination of two images, and A is linear, so that each step applies A and its
adjoint once.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import copy
from rift_cl.errors import InputError
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.solver import check_steps
from rift_cl.reconstruct.solvers.tv_functional import following_weight
from rift_cl.reconstruct.solvers.tv_problem import VariationSolver, VariationState

# A rise of the objective that no rounding explains; after a step without momentum it means that
# the norm of A was underestimated.
_RISE = 1e-5


@dataclass
class _State(VariationState):
    """What FISTA keeps.

    Args:
        image_before: the image of the step before.
        weighted_before: its weighted residual.
        t: Nesterov's weight.
        largest: the largest eigenvalue of A' F A, as it is believed to be.
    """

    image_before: Any
    weighted_before: Any
    t: float
    largest: float


class Fista(VariationSolver):
    """FISTA that has begun; arguments and errors are those of ``tv``.

    ``inner`` is the number of denoising steps within each step; ``direction_weights`` say how much
    a gradient counts by its direction (all alike if not given).
    """

    arrays = 14, 6
    least = MappingProxyType({"step": 0.0, "t": 1.0, "largest": 1e-300})
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
        inner: int = 5,
        direction_weights: DirectionWeights | None = None,
    ) -> None:
        super().__init__(
            A,
            y,
            weight,
            nonnegative=nonnegative,
            precondition=precondition,
            noise=noise,
            weights=weights,
            direction_weights=direction_weights,
        )
        self._inner = check_steps(inner, name="inner") if weight > 0 else 0
        if weight > 0 and self._inner == 0:
            raise InputError("inner is 0, wanted one denoising step or more")
        data = self.data
        begun = self._begin(start)
        before, seen = data.image(), data.data()
        copy(data.device, begun["image"], before)
        copy(data.device, begun["residual" if data.weight is None else "weighted"], seen)
        self._now = _State(
            **begun, image_before=before, weighted_before=seen, t=1.0, largest=self._largest
        )
        self._spare = data.image()

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        following = following_weight(now.t)
        momentum = (now.t - 1) / following
        weighted = now.residual if now.weighted is None else now.weighted
        # Both become what they are at the point ahead.
        axpby(device, 1 + momentum, now.image, -momentum, now.image_before)
        axpby(device, 1 + momentum, weighted, -momentum, now.weighted_before)
        data.gradient(now.weighted_before, self._spare)
        axpby(device, 1.0, now.image_before, -1 / now.largest, self._spare)
        self.variation.denoise(
            self._spare,
            now.dual,
            now.image_before,
            weight=self._strength / now.largest,
            steps=self._inner,
            nonnegative=self._nonnegative,
        )
        now.image, now.image_before = now.image_before, now.image
        self._measure()
        now.rms = data.rms(now.residual)
        before, now.objective = (
            now.objective,
            self._objective(now.image, now.residual, now.weighted),
        )
        now.t = following if now.objective <= before else 1.0
        if momentum == 0 and now.objective > (1 + _RISE) * before:
            now.largest *= 2
        now.step += 1

    def _measure(self) -> None:
        """The residual of the new image, and its weighted one; the last one moves to its place."""
        now, data = self._now, self.data
        if now.weighted is None:
            data.residual(now.image, now.weighted_before)
            now.residual, now.weighted_before = now.weighted_before, now.residual
            return
        data.residual(now.image, now.residual)
        data.weigh(now.residual, now.weighted_before)
        now.weighted, now.weighted_before = now.weighted_before, now.weighted
