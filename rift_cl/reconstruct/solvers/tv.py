"""Reconstruction under total variation by either method, as one function."""

from __future__ import annotations

from typing import Any

from rift_cl.errors import InputError
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.fista import Fista
from rift_cl.reconstruct.solvers.pdhg import Pdhg
from rift_cl.reconstruct.solvers.residual_weight import Precondition
from rift_cl.reconstruct.solvers.solver import solve

METHODS: dict[str, type[Pdhg] | type[Fista]] = {"pdhg": Pdhg, "fista": Fista}


def tv(
    A: LinearOperator,
    y: Any,
    weight: float,
    steps: int = 200,
    *,
    method: str = "pdhg",
    start: Any = None,
    nonnegative: bool = False,
    precondition: Precondition = None,
    noise: float | None = None,
    weights: Any = None,
    out: Any = None,
) -> Any:
    """Least squares with isotropic total variation.

    Minimises ``|F^(1/2) (A x - y)|^2 / 2 + weight * TV(x)``; F is the identity, or what
    ``precondition`` names. With ``weights`` W, whose mean over the samples that count is m, it is
    ``|F^(1/2) W^(1/2) (A x - y)|^2 / 2 + m weight * TV(x)``.

    Args:
        A: any linear operator from images (y, x) or volumes (z, y, x); its ``grid``, if it has one,
            gives the spacing of samples.
        y: the data, of shape ``A.range``.
        weight: of the variation, in the unit of y squared over the unit of TV, which is the
            integral of the gradient's length: an image's unit times length for an image, an image's
            unit for a volume.
            ``rift_cl.reconstruct.variation_weight(A, y)`` is a place to begin.
        steps: most steps.
        method: ``pdhg`` (Chambolle and Pock) or ``fista``; both go to the same minimum, at a pace
            that depends on the weight. Choose ``fista`` where it is more than some 100 times that
            of ``variation_weight``: 200 steps of ``pdhg`` may leave the objective some per cent
            above its minimum there. A step of ``fista`` takes five of denoising, and more memory.
            How far either has got is told by ``objective`` in the reports of
            ``rift_cl.reconstruct.Pdhg`` and ``Fista``: it stays once it is down.
        start: image to begin from; zero if not given.
        nonnegative: whether to keep the image >= 0.
        precondition: ``ramp`` or ``capped-voronoi``, for a projector, or a self-adjoint positive
            operator on ``A.range``: many times fewer steps, see ``residual_weight``.
        noise: standard deviation of the noise of a sample of y. The run ends once the residual is
            down to it, before the minimum if the weight is small, and a ramp spares frequencies in
            which there is little else.
        weights: how much each sample counts, of the shape of y: its relative inverse variance
            (``poisson_weights``), 0 where nothing was measured; y may be anything there. Their
            scale does not matter to the image; ``noise`` and the reported residual are those of a
            sample of weight 1.
        out: where to put the result.

    Returns:
        The image, of shape ``A.domain``, on the side (host or device) where ``y`` is, and an
        array of torch or JAX where that is one; no gradients pass.

    Raises:
        InputError: an argument does not fit, or holds NaN or infinity.
        NonFiniteError: squares of y, or of an image that fits it, leave the range of A's type.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}, wanted one of {', '.join(METHODS)}")
    solver = METHODS[method](
        A,
        y,
        weight,
        start=start,
        nonnegative=nonnegative,
        precondition=precondition,
        noise=noise,
        weights=weights,
    )
    return solve(solver, steps, like=y, out=out)
