"""Functions of torch that have a gradient, and no derivative of it.

Their gradients are the kernels'. torch takes what comes back from them for a constant, so that a
loss of it, as a penalty on a gradient, would leave its own part out without a word. So a
gradient that is asked for with ``create_graph`` refuses to be differentiated, whatever the loss.
torch's ``once_differentiable`` does so where the gradient that comes in has a derivative of its
own, which that of a loss linear in the image has not.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import torch

from rift_cl.errors import InputError

Backward = Callable[..., tuple[Any, ...]]


def one_derivative(backward: Backward) -> Backward:
    """Make a ``backward`` one whose results can be used, and not differentiated again."""

    @wraps(backward)
    def once(ctx: Any, *incoming: Any) -> tuple[Any, ...]:
        with torch.no_grad():
            found = backward(ctx, *incoming)
        if not torch.is_grad_enabled():
            return found
        return tuple(map(_last, found))

    return once


def apply(function: type[torch.autograd.Function], *args: Any) -> Any:
    """Apply such a function.

    Raises:
        InputError: a transform of ``torch.func`` wants its derivative.
    """
    try:
        return function.apply(*args)  # type: ignore[no-untyped-call]
    except RuntimeError as error:
        if "setup_context" not in str(error):
            raise
        raise InputError(
            "transforms of torch.func do not know splats: take gradients by .backward() or "
            "torch.autograd.grad, and views as a batch of cameras"
        ) from error


class _Last(torch.autograd.Function):
    """A tensor as it is, whose derivative is refused."""

    @staticmethod
    def forward(ctx: Any, found: torch.Tensor) -> torch.Tensor:
        """The same numbers."""
        return found.view_as(found)

    @staticmethod
    def backward(ctx: Any, *incoming: Any) -> Any:
        """Refuse.

        Raises:
            InputError: always.
        """
        raise InputError(
            "a gradient of splats is to be differentiated again (create_graph), as for a penalty "
            "on gradients: it has no derivative here, leave it out of the loss or detach() it"
        )


def _last(found: Any) -> Any:
    if found is None:
        return None
    return _Last.apply(found.detach().requires_grad_())  # type: ignore[no-untyped-call]
