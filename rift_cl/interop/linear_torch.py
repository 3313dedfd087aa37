"""Linear operators in torch: tensors in, tensors out, gradients of every order.

    from rift_cl.interop.linear_torch import apply

    loss = ((apply(A, image) - sinogram) ** 2).sum()
    loss.backward()

The gradient of ``A x`` is ``A.T`` of what comes back, an operator like A: it is applied by the
same function, so that gradients of gradients, forward derivatives and ``torch.func`` need nothing
more. Tensors cross by way of host memory, whatever device of torch's they are on.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch

from rift_cl.cl.host_arrays import check_finite
from rift_cl.errors import DTypeError
from rift_cl.interop.batches import apply_to_each
from rift_cl.interop.tensors import check_tensor, to_host
from rift_cl.operators.linear import LinearOperator

__all__ = ["apply"]


def apply(A: LinearOperator, x: torch.Tensor, *, name: str = "x") -> torch.Tensor:
    """Apply a linear operator to a tensor, or to each of a batch.

    Args:
        A: the operator: a projector, its adjoint, ``FilteredBackprojection``, any sum or product.
        x: (..., *A.domain) tensor of the operator's type, ``A.dtype``; leading dimensions, if
            any, are a batch.
        name: what the caller calls ``x``, for the sentence of an error.

    Returns:
        (..., *A.range) tensor of the same type, on the device of torch's where ``x`` is. It
        passes gradients on, of any order. A gradient in which something is not finite comes back
        as NaN throughout, as scaled losses of mixed precision ask for.

    Raises:
        DTypeError: ``x`` is no dense tensor of that type, or A is no operator.
        ShapeError: its last dimensions are not the operator's domain.
        DeviceError: it is on the meta device.
        NonFiniteError: it holds NaN or infinity.
    """
    if not isinstance(A, LinearOperator):
        raise DTypeError(f"A is a {type(A).__name__}, wanted a linear operator first, then {name}")
    _check(A, x, name)
    result: torch.Tensor = Apply.apply(A, x, name)  # type: ignore[no-untyped-call]
    return result


class Apply(torch.autograd.Function):
    """A linear operator as a function that autograd, ``torch.func`` and ``vmap`` know."""

    @staticmethod
    def forward(A: LinearOperator, x: torch.Tensor, name: str | None) -> torch.Tensor:
        """``A x`` for each of a batch; without a name, what is not finite is passed on."""
        host = to_host(x.resolve_neg())
        if name is not None:
            check_finite(host, name=name)
        elif not np.isfinite(host).all():
            return x.new_full((*_batch(A, x), *A.range), math.nan)
        return torch.from_numpy(apply_to_each(A, host)).to(x.device)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        """Remember the operator: a linear map's derivative depends on nothing else."""
        ctx.A = inputs[0]

    @staticmethod
    def backward(ctx: Any, *incoming: Any) -> tuple[Any, ...]:
        """The adjoint of what comes back."""
        return None, Apply.apply(ctx.A.T, incoming[0], None), None  # type: ignore[no-untyped-call]

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Any:
        """The operator itself."""
        return Apply.apply(ctx.A, tangents[1], None)  # type: ignore[no-untyped-call]

    @staticmethod
    def vmap(
        info: Any, in_dims: tuple[Any, ...], A: LinearOperator, x: torch.Tensor, name: str | None
    ) -> tuple[Any, int]:
        """One more dimension of the batch."""
        return Apply.apply(A, x.movedim(in_dims[1], 0), name), 0  # type: ignore[no-untyped-call]


def _batch(A: LinearOperator, x: torch.Tensor) -> tuple[int, ...]:
    return tuple(x.shape[: x.dim() - len(A.domain)])


def _check(A: LinearOperator, x: Any, name: str) -> None:
    dtype = torch.float64 if A.dtype == np.float64 else torch.float32
    batch = max(0, x.dim() - len(A.domain)) if isinstance(x, torch.Tensor) else 0
    check_tensor(name, x, ((None,) * batch + A.domain), dtype=dtype)
