"""Pixel losses by name: what the difference of one pixel and one channel costs.

A pixel loss is two expressions in OpenCL C, which become a part of ``kernels/train/loss_grad.cl``:
so one of a user's own is as fast as those of the package.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from rift_cl.errors import InputError, checked_flag
from rift_cl.registry import Registry

_SPACE, _WORD, _SIGNS = re.compile(r"\s+"), re.compile(r"\w"), "+-&|<>=!*/"


@dataclass(frozen=True)
class PixelLoss:
    """A loss of the difference d = image - target, both float32.

    Numbers in the expressions want an f behind them (``0.5f``); functions are OpenCL's (``sqrt``).
    On a CPU ``d`` and ``m`` are vectors of several pixels, so that what stands on both sides of a
    colon is to be made of them: ``d > 0 ? m : -m``, and not ``d > 0 ? 1 : -1``, which is
    ``sign(d)``.

    Args:
        value: the loss, an expression of ``d``.
        gradient: ``m`` times the derivative of the loss by d, an expression of ``d`` and ``m``.
        surrogate: the gradient is another than that of the value, and is meant to be. Otherwise a
            trainer compares the two before it begins.

    Raises:
        InputError: an expression is empty or no text.
    """

    value: str
    gradient: str
    surrogate: bool = False

    def __post_init__(self) -> None:
        """Check both expressions."""
        checked_flag("PixelLoss", "surrogate", self.surrogate)
        for name in ("value", "gradient"):
            given = getattr(self, name)
            if not isinstance(given, str) or not given.strip():
                raise InputError(f"PixelLoss: {name} is {given!r}, wanted an expression of d")

    def macros(self) -> dict[str, str]:
        """The expressions as compile-time constants, without spaces: drivers split at them."""
        expressions = {"PIXEL_LOSS": self.value, "PIXEL_GRADIENT": self.gradient}
        return {name: _SPACE.sub(_without_space, text) for name, text in expressions.items()}


def _without_space(space: re.Match[str]) -> str:
    """Nothing, or a comment where two parts would become another, as in ``a - -b``."""
    before, after = space.string[: space.start()][-1:], space.string[space.end() :][:1]
    words = _WORD.match(before) and _WORD.match(after)
    signs = before and after and before in _SIGNS and after in _SIGNS
    return "/**/" if words or signs else ""


PIXEL_LOSSES = Registry(
    "pixel loss",
    {"l1": PixelLoss("absolute(d)", "d > 0 ? m : d < 0 ? -m : 0"), "l2": PixelLoss("d*d", "2*d*m")},
)
OURS = PIXEL_LOSSES.names


def register_loss(name: str, loss: PixelLoss, *, replace: bool = False) -> None:
    """Make a pixel loss known by a name, for ``TrainSettings(loss=name)`` and ``ImageLoss``.

    Args:
        name: what it is called from now on, in this process.
        loss: its value and gradient.
        replace: take the place of one that was registered by that name before.

    Raises:
        InputError: the name is taken, or it is no ``PixelLoss``.
    """
    if not isinstance(loss, PixelLoss):
        raise InputError(f"register_loss: {loss!r} is not a PixelLoss")
    PIXEL_LOSSES.add(name, loss, replace=replace)
