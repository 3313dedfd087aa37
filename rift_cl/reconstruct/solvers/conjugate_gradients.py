"""Conjugate gradients on the normal equations (Hestenes and Stiefel 1952).

Of all images that k steps can reach, the k-th is the one with the least ``|F^(1/2) (A x - y)|``.
On noisy data the steps regularise: what every view sees comes first, noise last, so that one stops
when the residual is down to the noise. Negative values cannot be excluded, since directions would
no longer be conjugate; SIRT and total variation can do that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.reductions import dot
from rift_cl.errors import InputError
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.solver import Solver, SolverState, solve

# Squares below this have lost digits, or all of them, in float32.
_FAINTEST = 1e-30


@dataclass
class _State(SolverState):
    """What conjugate gradients keep.

    Args:
        weighted: F times the residual; None where there is no F.
        direction: of the next step.
        slope: squared norm of the gradient.
    """

    weighted: Any
    direction: Any
    slope: float


class Cgls(Solver):
    """Conjugate gradients that have begun; arguments and errors are those of ``cgls``."""

    arrays = 3, 5
    _now: _State

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        *,
        start: Any = None,
        precondition: Precondition = None,
        noise: float | None = None,
        weights: Any = None,
    ) -> None:
        data = DataTerm(A, y, precondition, noise, self.arrays, weights)
        super().__init__(data, noise)
        image, residual, direction = data.start(start), data.data(), data.image()
        data.residual(image, residual)
        weighted = None if data.weight is None else data.data()
        if weighted is not None:
            data.weigh(residual, weighted)
        data.gradient(residual if weighted is None else weighted, direction)
        axpby(data.device, 0.0, direction, -1.0, direction)
        slope = dot(data.device, direction, direction)
        if 0 < slope < _FAINTEST:
            raise InputError(
                f"y and A are so small that squares do not fit {data.dtype}: scale lengths and "
                "values to near 1"
            )
        rms = data.rms(residual)
        self._now = _State(image, residual, 0, rms, weighted, direction, slope)
        self._spare = data.data(), data.data(), data.image()

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        seen, weighted, gradient = self._spare
        data.A(now.direction, out=seen)
        data.weigh(seen, weighted)
        curvature = dot(device, seen, weighted)
        if not (now.slope > 0 and curvature > 0):
            self._exhausted = True
            return
        length = now.slope / curvature
        axpby(device, length, now.direction, 1.0, now.image)
        axpby(device, length, seen, 1.0, now.residual)
        if now.weighted is not None:
            axpby(device, length, weighted, 1.0, now.weighted)
        data.gradient(now.residual if now.weighted is None else now.weighted, gradient)
        slope = dot(device, gradient, gradient)
        axpby(device, -1.0, gradient, slope / now.slope, now.direction)
        now.slope, now.rms = slope, data.rms(now.residual)
        now.step += 1


def cgls(
    A: LinearOperator,
    y: Any,
    steps: int = 30,
    *,
    start: Any = None,
    precondition: Precondition = None,
    noise: float | None = None,
    weights: Any = None,
    out: Any = None,
) -> Any:
    """Least squares by conjugate gradients.

    Minimises ``|F^(1/2) (A x - y)|``; F is the identity, or what ``precondition`` names. On a
    volume one step length serves all slices.

    Args:
        A: any linear operator.
        y: the data, of shape ``A.range``.
        steps: most steps.
        start: image to begin from; zero if not given.
        precondition: ``ramp`` or ``capped-voronoi``, for a projector, or a self-adjoint positive
            operator on ``A.range``: several times fewer steps, see ``residual_weight``.
        noise: standard deviation of the noise of a sample of y. The run ends once the residual is
            down to it, and a ramp spares frequencies in which there is little else.
        weights: how much each sample counts, of the shape of y: its relative inverse variance
            (``poisson_weights``), 0 where nothing was measured; y may be anything there. ``noise``
            and the reported residual are then those of a sample of weight 1, and
            ``|F^(1/2) W^(1/2) (A x - y)|`` is what becomes small.
        out: where to put the result.

    Returns:
        The image, of shape ``A.domain``, on the side (host or device) where ``y`` is.

    Raises:
        InputError: an argument does not fit, or holds NaN or infinity.
    """
    solver = Cgls(A, y, start=start, precondition=precondition, noise=noise, weights=weights)
    return solve(solver, steps, like=y, out=out)
