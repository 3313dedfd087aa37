"""Linear coefficients by ridge least squares inside a fit, while only the geometry is optimised.

Where pictures are linear in some of the parameters (all coefficients of additive splats are), those
need no steps of an optimiser: for every geometry there is a best choice. Its residual is orthogonal
to what the splats can show, so that the loss, as a function of the geometry alone, has the partial
gradient at fixed coefficients (variable projection, Golub and Pereyra 1973; the shortened gradient
is Kaufman's, 1975). The solver only asks for pictures and for their adjoint, and starts where the
last geometry's solution was, so that a few conjugate gradients a step are enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number

Floats = NDArray[np.float64]
Linear = Callable[[Floats], Floats]
# Squared norms below this share of the first one are rounding.
_EXHAUSTED = 1e-30
# No step raises the loss by more than this share of it, unless gradients are no more than the
# rounding of what is rendered: steps go astray from there on, and ever faster.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Solution:
    """What ``solve`` found.

    Args:
        coefficients: of any shape that ``render`` takes.
        residual: targets minus what the coefficients render, of the targets' shape.
        steps: conjugate gradients that were taken.
        loss_before: what is minimised, of the coefficients that it began with.
    """

    coefficients: Floats
    residual: Floats
    steps: int
    loss_before: float


def solve(
    render: Linear,
    adjoint: Linear,
    targets: Floats,
    *,
    ridge: float,
    iterations: int,
    start: Floats | None = None,
    diagonal: Floats | None = None,
    free: NDArray[np.bool_] | None = None,
) -> Solution:
    """Minimise ``|render(c) - targets|^2 + ridge |c|^2`` by conjugate gradients (CGLS).

    Each step asks for one picture and one adjoint; the last one for no adjoint.

    Args:
        render: coefficients to pictures, linear.
        adjoint: its transpose, pictures to coefficients.
        targets: what is to be rendered, of any shape.
        ridge: weight of the squared coefficients, 0 or more.
        iterations: most steps, 1 or more.
        start: coefficients to begin from; zero if not given.
        diagonal: about the squared norm of each coefficient's pictures, of the coefficients'
            shape, all positive: steps then count in coefficients of equal effect.
        free: of the coefficients' shape, which of them are solved for; the others stay at what
            they are in ``start``. All are if not given.

    Raises:
        InputError: ``ridge`` or ``iterations`` is out of its range, or ``diagonal`` not positive.
        ShapeError: ``start``, ``diagonal``, ``free`` or what ``render`` returns does not fit.
        NonFiniteError: the targets, or what is rendered, hold NaN or infinity.
    """
    _check(ridge, iterations, diagonal)
    targets = np.asarray(targets, np.float64)
    c, r, gradient = _begin(render, adjoint, targets, ridge, start)
    moves = _moves(c.shape, diagonal, free)
    direction = moves * gradient
    slope = first = float(np.vdot(gradient, direction))
    loss = _loss(r, c, ridge)
    found = Solution(c, r, 0, loss)
    for step in range(iterations):
        if not slope > _EXHAUSTED * first:
            break
        seen = _rendered(render, direction, targets)
        curvature = _loss(seen, direction, ridge)
        if not curvature > 0:
            break
        c, r = c + slope / curvature * direction, r - slope / curvature * seen
        before, loss = loss, _loss(r, c, ridge)
        if loss > before * (1 + _ROUNDING):
            break
        found = replace(found, coefficients=c, residual=r, steps=step + 1)
        if step + 1 < iterations:
            gradient = adjoint(r) - ridge * c
            last, slope = slope, float(np.vdot(gradient, moves * gradient))
            direction = moves * gradient + slope / last * direction
    return found


def mean_curvature(render: Linear, shape: tuple[int, ...], *, seed: int = 0) -> float:
    """About the mean squared norm of one coefficient's pictures, by a random probe.

    A ridge is told best as a share of it: the same number then means the same for few large splats
    and for many small ones (Hutchinson 1989).

    Args:
        render: as in ``solve``.
        shape: of the coefficients.
        seed: of the signs.
    """
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), shape)
    seen = render(signs)
    return float(np.vdot(seen, seen)) / signs.size


def _check(ridge: float, iterations: int, diagonal: Floats | None) -> None:
    if not one_number(ridge) >= 0:
        raise InputError(f"solve: ridge is {ridge!r}, wanted a finite number >= 0")
    if isinstance(iterations, bool) or not one_number(iterations) >= 1 or iterations % 1:
        raise InputError(f"solve: iterations is {iterations!r}, wanted a whole number >= 1")
    if diagonal is not None and not (np.isfinite(diagonal).all() and np.all(diagonal > 0)):
        raise InputError("solve: diagonal holds numbers that are not positive and finite")


def _moves(
    shape: tuple[int, ...], diagonal: Floats | None, free: NDArray[np.bool_] | None
) -> Floats:
    """How far each coefficient goes along the gradient; those that are held go nowhere."""
    moves = np.ones(shape)
    for name, given in (("diagonal", diagonal), ("free", free)):
        if given is not None and given.shape != shape:
            raise ShapeError(f"solve: {name} has shape {given.shape}, wanted {shape}")
    if diagonal is not None:
        moves /= diagonal
    return moves if free is None else moves * free


def _loss(r: Floats, c: Floats, ridge: float) -> float:
    return float(np.vdot(r, r) + ridge * np.vdot(c, c))


def _begin(
    render: Linear, adjoint: Linear, targets: Floats, ridge: float, start: Floats | None
) -> tuple[Floats, Floats, Floats]:
    """Coefficients to begin with, their residual, and the negative gradient there."""
    r = targets.copy()
    if start is not None:
        r -= _rendered(render, np.asarray(start, np.float64), targets)
    gradient = np.asarray(adjoint(r), np.float64)
    c = np.zeros_like(gradient) if start is None else np.array(start, np.float64)
    if gradient.shape != c.shape:
        raise ShapeError(f"solve: start has shape {c.shape}, the adjoint gives {gradient.shape}")
    if not np.isfinite(gradient).all():
        raise NonFiniteError("solve: targets or their adjoint hold NaN or infinity")
    return c, r, gradient - ridge * c


def _rendered(render: Linear, c: Floats, targets: Floats) -> Floats:
    seen = np.asarray(render(c), np.float64)
    if seen.shape != targets.shape:
        raise ShapeError(f"solve: pictures have shape {seen.shape}, targets {targets.shape}")
    if not np.isfinite(seen).all():
        raise NonFiniteError("solve: what is rendered holds NaN or infinity; look at the geometry")
    return seen
