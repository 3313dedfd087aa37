"""Conjugate gradients on the normal equations (Hestenes and Stiefel 1952).

Of all images that k steps can reach, the k-th is the one with the least

    |F^(1/2) (A x - y)|^2 + ridge |x|^2.

On noisy data the steps regularize: what every view sees comes first, noise last, so that one stops
when the residual is down to the noise. Negative values cannot be excluded, since directions would
no longer be conjugate; SIRT and total variation can do that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import copy, multiply
from rift_cl.cl.host_arrays import as_real_array
from rift_cl.cl.reductions import dot, norm
from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.solver import Solver, SolverState, solve

# A step that raises what is minimized by more than so many units of rounding goes along rounding,
# and the next ones would go astray ever faster: the run ends before it. So it does before a step
# that would lower it by less than the square of that unit.
_ROUNDING = 10


@dataclass
class _State(SolverState):
    """What conjugate gradients keep.

    Args:
        weighted: F times the residual; None where there is no F.
        direction: of the last step; of the first one before it.
        slope: how fast what is minimized falls along it: the squared norm of the gradient, in the
            measure of the diagonal.
        loss: what is minimized.
    """

    weighted: Any
    direction: Any
    slope: float
    loss: float


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
        ridge: float = 0.0,
        diagonal: Any = None,
        free: Any = None,
    ) -> None:
        images, sinograms = self.arrays
        scaled = diagonal is not None or free is not None
        data = DataTerm(A, y, precondition, noise, (images + 2 * scaled, sinograms), weights)
        super().__init__(data, noise)
        self._ridge = _checked_ridge(ridge)
        # How far each sample goes along the gradient; those that are held go nowhere.
        self._scale = data.home.array(_scale(A, diagonal, free)) if scaled else None
        image, residual, direction = data.start(start), data.data(), data.image()
        data.residual(image, residual)
        weighted = None if data.weight is None else data.data()
        self._now = _State(
            image, residual, 0, data.rms(residual), weighted, direction, slope=0.0, loss=0.0
        )
        if weighted is not None:
            data.weigh(residual, weighted)
        self._now.loss = self._loss(self._now.rms)
        gradient = data.image()
        self._spare = data.data(), data.data(), gradient, data.image() if scaled else gradient
        self._turn()
        self._check(self._now.slope)

    @property
    def loss(self) -> float:
        """What is minimized, at the image so far."""
        return self._now.loss

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        if now.step:
            self._turn()
        seen, weighted, *_ = self._spare
        data.A(now.direction, out=seen)
        data.weigh(seen, weighted)
        curvature = dot(device, seen, weighted) + self._pull(now.direction)
        self._check(curvature, now.slope)
        unit = float(np.finfo(data.dtype).eps)
        if curvature < 0:
            self._check_positive(curvature, seen, weighted)
        if not (now.slope > 0 and curvature > 0 and now.slope**2 > unit**2 * now.loss * curvature):
            self._exhausted = True
            return
        length = now.slope / curvature
        self._move(length, seen, weighted)
        rms = data.rms(now.residual)
        loss = self._loss(rms)
        if loss > now.loss * (1 + _ROUNDING * unit):
            self._move(-length, seen, weighted)
            self._exhausted = True
            return
        now.rms, now.loss = rms, loss
        now.step += 1

    def _check(self, *values: float) -> None:
        """Refuse to go on with numbers that the type does not hold."""
        if not np.isfinite(values).all():
            raise NonFiniteError(
                f"A' A y is beyond {self.data.dtype}: scale lengths, values and weights to near 1"
            )

    def _check_positive(self, curvature: float, seen: Any, weighted: Any) -> None:
        """Refuse a preconditioner by which some residual counts less than nothing.

        Rounding may leave a negative number too, where F leaves next to nothing of what is seen, or
        where the step would lower the loss by no more than rounding: that is the end of a run.

        Raises:
            InputError: it is not positive definite.
        """
        now, device, unit = self._now, self.data.device, float(np.finfo(self.data.dtype).eps)
        rounding = _ROUNDING * unit * norm(device, seen) * norm(device, weighted)
        if curvature < -rounding and now.slope**2 > unit * abs(now.loss * curvature):
            raise InputError(
                "precondition is not positive definite, so that the weighted residual has no "
                "minimum: wanted a self-adjoint positive definite operator"
            )

    def _turn(self) -> None:
        """Make the direction that of the next step: conjugate to those before."""
        now, data, device = self._now, self.data, self.data.device
        _, _, gradient, scaled = self._spare
        data.gradient(now.residual if now.weighted is None else now.weighted, gradient)
        if self._ridge:
            axpby(device, self._ridge, now.image, 1.0, gradient)
        if self._scale is not None:
            copy(device, gradient, scaled)
            multiply(device, self._scale, scaled)
        slope = dot(device, gradient, scaled)
        if now.step:
            axpby(device, -1.0, scaled, slope / now.slope, now.direction)
        else:
            copy(device, scaled, now.direction)
            axpby(device, 0.0, now.direction, -1.0, now.direction)
        now.slope = slope

    def _move(self, length: float, seen: Any, weighted: Any) -> None:
        """Go so far along the direction, which A makes ``seen`` and F A ``weighted``."""
        now, device = self._now, self.data.device
        axpby(device, length, now.direction, 1.0, now.image)
        axpby(device, length, seen, 1.0, now.residual)
        if now.weighted is not None:
            axpby(device, length, weighted, 1.0, now.weighted)

    def _loss(self, rms: float) -> float:
        """What is minimized, from the root mean square of the residual that there is."""
        now, data = self._now, self.data
        if now.weighted is None:
            return rms**2 * data.samples + self._pull(now.image)
        return dot(data.device, now.residual, now.weighted) + self._pull(now.image)

    def _pull(self, x: Any) -> float:
        """The ridge's part of the loss."""
        return self._ridge * dot(self.data.device, x, x) if self._ridge else 0.0


def cgls(
    A: LinearOperator,
    y: Any,
    steps: int = 30,
    *,
    start: Any = None,
    precondition: Precondition = None,
    noise: float | None = None,
    weights: Any = None,
    ridge: float = 0.0,
    diagonal: Any = None,
    free: Any = None,
    out: Any = None,
) -> Any:
    """Least squares by conjugate gradients.

    Minimizes ``|F^(1/2) (A x - y)|^2 + ridge |x|^2``; F is the identity, or what ``precondition``
    names. On a volume one step length serves all slices.

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
        ridge: weight of the squared image, 0 or more (Tikhonov regularization).
        diagonal: preconditioner on the image: about the diagonal of ``A' F A``, of shape
            ``A.domain``, all positive. Steps then count in samples of equal effect.
        free: which samples of the image are solved for, booleans of shape ``A.domain``; the others
            stay what they are in ``start``. All of them by default.
        out: where to put the result.

    Returns:
        The image, of shape ``A.domain``, on the side (host or device) where ``y`` is, and an
        array of torch or JAX where that is one; no gradients pass.

    Raises:
        InputError: an argument does not fit, is out of its range, or holds NaN or infinity; or
            ``precondition`` turns out not to be positive.
        NonFiniteError: lengths, values or weights are so large that numbers do not fit the type.
    """
    solver = Cgls(
        A,
        y,
        start=start,
        precondition=precondition,
        noise=noise,
        weights=weights,
        ridge=ridge,
        diagonal=diagonal,
        free=free,
    )
    return solve(solver, steps, like=y, out=out)


def mean_diagonal(A: LinearOperator, *, seed: int = 0) -> float:
    """About the mean of the diagonal of A' A, by a random probe (Hutchinson 1989).

    That is the mean squared norm of what one sample of the image becomes. A ridge is told best as
    a share of it: the same number then means the same whatever the size of A.

    Args:
        A: any linear operator.
        seed: of the signs of the probe.
    """
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), A.domain)
    seen = A(A.device.array(signs, A.dtype))
    return dot(A.device, seen, seen) / signs.size


def _checked_ridge(ridge: float) -> float:
    number = one_number(ridge)
    if not number >= 0:
        raise InputError(f"ridge is {ridge!r}, wanted a finite number, 0 or more")
    return number


def _scale(A: LinearOperator, diagonal: Any, free: Any) -> Any:
    """The inverse of the diagonal, 0 where a sample is held; on the host."""
    scale = np.ones(A.domain)
    if diagonal is not None:
        given = as_real_array(diagonal, name="diagonal")
        if given.shape != A.domain:
            raise ShapeError(f"diagonal has shape {given.shape}, wanted {A.domain}")
        if not (np.isfinite(given).all() and (given > 0).all()):
            raise InputError("diagonal holds numbers that are not positive and finite")
        scale /= given
    if free is not None:
        mask = np.asarray(free)
        if mask.shape != A.domain or mask.dtype != np.bool_:
            raise ShapeError(
                f"free is {mask.dtype} of shape {mask.shape}, wanted booleans of {A.domain}"
            )
        scale *= mask
    return scale
