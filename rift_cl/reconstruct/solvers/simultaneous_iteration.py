"""SIRT: every step spreads each ray's error over the pixels that the ray crosses.

    x <- x + relaxation * C A' R (y - A x),

R one over the sums of A's rows and C one over the sums of its columns (Gilbert 1972; Gregor and
Benson, IEEE Trans. Med. Imaging 27, 2008). It minimises ``|R^(1/2) (A x - y)|``, converges for any
relaxation below 2, and can keep the image from negative values.

Weights W of the rays take the place of R: C is then one over ``A' W A 1``, which bounds the
curvature of ``|W^(1/2) (A x - y)|^2`` pixel by pixel (Erdogan and Fessler, Phys. Med. Biol. 44,
1999). W = R is the case without weights.

With a weight F of the residual that takes the place of the sums,

    x <- x + relaxation / L * A' F (y - A x),

L the largest eigenvalue of A' F A. As F may leave a residual that is never down to the noise (see
``residual_weight``), and steps beyond the noise do harm, that run also ends once the weighted
residual is well below the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array_home import ArrayHome
from rift_cl.cl.elementwise import clip_negative, copy, multiply
from rift_cl.cl.passing_parts import runs
from rift_cl.errors import InputError, checked_flag
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.solver import Solver, SolverState, solve

# A ray that crosses less than this share of what the longest does says nothing, and counts as
# none; the same for a pixel.
_LEAST = 1e-3
# Beside an edge, sums of an operator whose band ends (``FastProjector``) ring about their value, by
# up to 9 % of the step (J. W. Gibbs). Sums below zero by more than this share of the largest are
# no ringing.
_RINGING = 0.1
# The weighted residual's root mean square that ends a run, in units of the noise. On phantoms with
# sharp and smooth parts it came within 1.3 dB of the best image in seven cases of eight.
_WELL_BELOW = 0.9
# Times the residual at first. In the measure of R, which differs from ray to ray by 1 / _LEAST at
# most, no step raises the residual, so that its root mean square rises by 32 times at most.
_DIVERGED = 100
_CAUSES = {
    "A": "A has negative weights, which the sums of its rows and columns do not show; use cgls",
    "precondition": "precondition is not a self-adjoint positive operator",
}


@dataclass
class _State(SolverState):
    """What SIRT keeps.

    Args:
        weighted: F times the residual; None where there is no F.
        weighted_rms: root mean square of F^(1/2) times the residual.
    """

    weighted: Any
    weighted_rms: float


class Sirt(Solver):
    """SIRT that has begun; arguments and errors are those of ``sirt``."""

    arrays = 5, 6
    _now: _State

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        *,
        start: Any = None,
        nonnegative: bool = False,
        relaxation: float = 1.0,
        precondition: Precondition = None,
        noise: float | None = None,
        weights: Any = None,
    ) -> None:
        if not 0 < one_number(relaxation) < 2:
            raise InputError(f"relaxation is {relaxation!r}, wanted a number between 0 and 2")
        self._nonnegative = checked_flag("sirt", "nonnegative", nonnegative)
        data = DataTerm(A, y, precondition, noise, self.arrays, weights)
        super().__init__(data, noise)
        self._rays, self._pixels, self._length = None, None, float(relaxation)
        if data.weight is None and weights is None:
            self._rays, self._pixels = (inverse_sums(B, data.home) for B in (A, A.T))
        elif data.weight is None:
            self._pixels = inverse_sums(data.A.T @ data.A, data.home)
        else:
            largest = data.norm_squared()
            self._length = relaxation / largest if largest > 0 else 0.0
        image, residual = data.start(start), data.data()
        if self._nonnegative:
            clip_negative(data.device, image)
        weighted = None if data.weight is None else data.data()
        self._now = _State(image, residual, 0, 0.0, weighted, 0.0)
        self._measure()
        self._most = residual_bound(data, self._now.rms)
        self._spare = data.data(), data.image()

    @property
    def finished(self) -> bool:
        """Whether the residual is down to the noise, or the weighted one well below it."""
        if super().finished or self._target is None or self._now.weighted is None:
            return super().finished
        below = self._now.weighted_rms <= _WELL_BELOW * self._target
        return below and self.data.unit_gain

    def _measure(self) -> None:
        now, data = self._now, self.data
        data.residual(now.image, now.residual)
        now.rms = data.rms(now.residual)
        if now.weighted is not None:
            data.weigh(now.residual, now.weighted)
            now.weighted_rms = data.weighted_rms(now.residual, now.weighted)

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        spread, change = self._spare
        pull = now.residual if now.weighted is None else now.weighted
        if self._rays is not None:
            copy(device, now.residual, spread)
            multiply(device, self._rays, spread)
            pull = spread
        data.gradient(pull, change)
        if self._pixels is not None:
            multiply(device, self._pixels, change)
        axpby(device, -self._length, change, 1.0, now.image)
        if self._nonnegative:
            clip_negative(device, now.image)
        self._measure()
        now.step += 1
        check_converges(now, self._most, "A" if data.weight is None else "precondition")


def residual_bound(data: DataTerm, rms: float) -> float:
    """What no residual of steps that converge exceeds, from that of the image at first."""
    return _DIVERGED * max(rms, data.rms(data.y))


def check_converges(now: SolverState, most: float, cause: str) -> None:
    """Stop where the residual has grown, as it then does without end.

    Args:
        now: the state after a step.
        most: see ``residual_bound``.
        cause: what lets steps diverge, ``A`` or ``precondition``.

    Raises:
        InputError: the residual is beyond the bound.
    """
    if now.rms > most:
        raise InputError(
            f"SIRT diverges (residual {now.rms:.2g} after step {now.step}): {_CAUSES[cause]}"
        )


def inverse_sums(A: LinearOperator, home: ArrayHome) -> Any:
    """One over the sums of an operator's rows, kept at home; 0 where they are next to 0.

    Where sums ring below zero, none counts for less than that: a ray that grazes the image would
    get a weight that only ringing has made large.

    Raises:
        InputError: a sum is negative, and not by ringing.
    """
    sums = home.host(A(home.made(A.domain, np.ones), out=home.empty(A.range)))
    largest = float(sums.max(initial=0.0))
    below = -float(sums.min(initial=0.0))
    if below > _RINGING * largest:
        raise InputError(
            "A has rows or columns with a negative sum, and SIRT wants weights >= 0: use cgls"
        )
    flat = sums.reshape(-1)
    for run in runs(flat.size):
        given = flat[run].astype(np.float64)
        counts = given > _LEAST * largest
        flat[run] = np.where(counts, 1 / np.where(counts, np.maximum(given, below), 1), 0)
    return home.array(sums) if home.on_device else sums


def sirt(
    A: LinearOperator,
    y: Any,
    steps: int = 100,
    *,
    start: Any = None,
    nonnegative: bool = False,
    relaxation: float = 1.0,
    precondition: Precondition = None,
    noise: float | None = None,
    weights: Any = None,
    subsets: int = 1,
    out: Any = None,
) -> Any:
    """Simultaneous iterative reconstruction: ``x <- x + relaxation * C A' R (y - A x)``.

    R is one over the sums of the rows of A, C one over those of its columns. Rays whose sum is
    below a thousandth of the largest, which hardly touch the grid, are left out, and so are such
    pixels (``rift_cl.reconstruct.solvers.simultaneous_iteration`` has the sources).

    Args:
        A: a linear operator without negative weights (with ``precondition``: any).
        y: the data, of shape ``A.range``.
        steps: most steps.
        start: image to begin from; zero if not given.
        nonnegative: whether to keep the image >= 0, the one to begin from too.
        relaxation: length of a step, between 0 and 2.
        precondition: ``ramp`` or ``capped-voronoi``, for a projector, or a self-adjoint positive
            operator on ``A.range``: many times fewer steps, see ``residual_weight``.
        noise: standard deviation of the noise of a sample of y. The run ends once the residual is
            down to it (with a ramp also once the weighted residual is well below it), and a ramp
            spares frequencies in which there is little else.
        weights: how much each sample counts, of the shape of y: its relative inverse variance
            (``poisson_weights``), 0 where nothing was measured; y may be anything there. ``noise``
            and the reported residual are then those of a sample of weight 1, and
            ``|F^(1/2) W^(1/2) (A x - y)|`` is what becomes small. They take the place of R: without
            them a ray counts by one over its length in the image, so that equal weights give
            another image than none.
        subsets: correct the image after each of so many subsets of the views (see
            ``ordered_subsets``): with 10, about ten times fewer steps. Not with ``precondition``.
        out: where to put the result.

    Returns:
        The image, of shape ``A.domain``, on the side (host or device) where ``y`` is, and an
        array of torch or JAX where that is one; no gradients pass.

    Raises:
        InputError: an argument does not fit, or holds NaN or infinity; or the steps diverge, as
            they do where A has negative weights.
    """
    if one_number(subsets) != 1:
        from rift_cl.reconstruct.solvers.ordered_subsets import OrderedSubsets

        if precondition is not None:
            raise InputError(
                "precondition and subsets are both given: each saves steps, choose one of them"
            )
        given = {"start": start, "nonnegative": nonnegative, "relaxation": relaxation}
        parts = OrderedSubsets(A, y, subsets, noise=noise, weights=weights, **given)
        return solve(parts, steps, like=y, out=out)
    solver = Sirt(
        A,
        y,
        start=start,
        nonnegative=nonnegative,
        relaxation=relaxation,
        precondition=precondition,
        noise=noise,
        weights=weights,
    )
    return solve(solver, steps, like=y, out=out)
