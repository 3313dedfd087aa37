"""PDHG: the primal-dual hybrid gradient of Chambolle and Pock for total variation.

Both terms are written by their duals, p for the data and u for the variation (J. Math. Imaging Vis.
40, 2011; ICCV 2011 for steps that are operators), so that no step has an inner iteration:

    x <- max(0, x - tau (A' p + D' u)),
    p <- (p + sigma F (A x~ - y)) / (1 + sigma),
    u <- u + s D x~, each vector shortened to the weight,        x~ = 2 x_new - x_old.

The weight F of the residual enters as the step ``sigma F`` of p: in that metric the proximal map of
the data term, whose conjugate has the inverse of F, needs no inverse. With ``s = kappa |A' F A| /
|D|^2`` the steps converge since ``tau (sigma + kappa) |A' F A| <= 1``.

The vectors u grow up to the weight, so that a strong variation wants long steps of u, and short
ones of the image (``_balance``). Steps stay as they are from the first to the last.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import clip_between
from rift_cl.cl.reductions import norm
from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.tv_problem import VariationSolver, VariationState

# Step of the data's dual, a number without unit. A small one gives momentum, and the worse the
# condition of A the smaller is best: of 0.01 to 1 these did well for strong and weak variation on a
# 96^2 image from 96 views, the first without a weight of the residual and the second with one.
_SIGMA, _WEIGHTED_SIGMA = 0.03, 0.2
# Kappa over the strength of the variation, without a weight of the residual and with one; the most
# that kappa is, and the most that sigma follows it. By trial on 64^2 images (few views, many, a
# wedge) and cones, with weights of 0.01 to 1000 times ``variation_weight`` and 200 steps.
_KAPPA, _WEIGHTED_KAPPA = 3.0, 1.0
_MOST_KAPPA, _MOST_SIGMA = 10.0, 0.2


@dataclass
class _State(VariationState):
    """What PDHG keeps.

    Args:
        data_dual: the dual of the data term.
    """

    data_dual: Any


class Pdhg(VariationSolver):
    """PDHG that has begun; arguments and errors are those of ``tv``, and these.

    Args:
        bounds: least and greatest value of the image, each a number or an array of ``A.domain``;
            with an upper bound of 0 outside a support nothing is put there.
        direction_weights: how much a gradient counts by its direction.
        sigma: step of the data's dual, and of the variation's (kappa), a number without unit; a
            smaller one gets further where A is badly conditioned, as with a wedge of views. By the
            strength of the variation if not given.

    Raises:
        InputError: bounds cross each other or are given beside ``nonnegative``, or sigma is not
            positive.
    """

    arrays = 10, 7
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
        bounds: tuple[Any, Any] | None = None,
        direction_weights: DirectionWeights | None = None,
        sigma: float | None = None,
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
        data = self.data
        if bounds is not None and nonnegative:
            raise InputError("bounds and nonnegative are both given: make 0 the lower bound")
        if sigma is not None and not one_number(sigma) > 0:
            raise InputError(f"sigma is {sigma!r}, wanted a positive number")
        self._bounds = None if bounds is None else checked_bounds(bounds, data)
        largest = self._largest
        dual = data.home.zeros(A.range)
        self._now = _State(**self._begin(start), data_dual=dual)
        self._spare = data.image(), data.data()
        self._sigma, kappa = self._balance() if sigma is None else (float(sigma),) * 2
        self._tau = 1 / ((self._sigma + kappa) * largest)
        steepest = self.variation.norm_squared
        self._step = kappa * largest / steepest if steepest else 0.0

    def _balance(self) -> tuple[float, float]:
        """Sigma and kappa for the variation's strength, both the usual sigma where it is weak.

        The strength is the most that the variation can pull at an image, ``weight |D|`` at every
        sample, as a share of the data's pull at an image of zeros, ``|A' F y|``.
        """
        data, variation = self.data, self.variation
        image, weighted = self._spare
        data.weigh(data.y, weighted)
        data.gradient(weighted, image)
        pull = norm(data.device, image)
        most = self._strength * variation.cell * sqrt(variation.norm_squared * image.size)
        weighs = data.weight is not None
        usual, factor = (_WEIGHTED_SIGMA, _WEIGHTED_KAPPA) if weighs else (_SIGMA, _KAPPA)
        wanted = min(factor * most / pull, _MOST_KAPPA) if pull else usual
        return max(usual, min(wanted, _MOST_SIGMA)), max(usual, wanted)

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        image, fresh = self._spare
        data.gradient(now.data_dual, image)
        self.variation.add_adjoint(1.0, image, 1.0, now.dual, image)
        self._add_pull(image)
        axpby(device, 1.0, now.image, -self._tau, image)
        self._constrain(image)
        # The old image becomes the point ahead, 2 new - old.
        axpby(device, 2.0, image, -1.0, now.image)
        radius = self._strength * self.variation.cell
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

    def _add_pull(self, gradient: Any) -> None:
        """Add the gradient of what else is minimised, at the image; nothing here."""

    def _constrain(self, image: Any) -> None:
        if self._bounds is None:
            super()._constrain(image)
        else:
            clip_between(self.data.device, *self._bounds, image)

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


def checked_bounds(bounds: Any, data: DataTerm) -> tuple[Any, Any]:
    """The least and greatest image.

    Raises:
        InputError: they are not two, do not fit the image, are not finite, or cross each other.
    """
    try:
        low, high = bounds
        both = [np.broadcast_to(np.asarray(end, np.float64), data.A.domain) for end in (low, high)]
    except (TypeError, ValueError):
        raise InputError(
            f"bounds are wanted as two, each a number or an array of shape {data.A.domain}"
        ) from None
    if not all(np.isfinite(end).all() for end in both):
        raise InputError("bounds hold NaN or infinity: leave them out where there are none")
    if (both[0] > both[1]).any():
        raise InputError("bounds cross: the lower one is above the upper one somewhere")
    low, high = (data.home.array(np.ascontiguousarray(end)) for end in both)
    return low, high
