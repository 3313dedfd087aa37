"""The Gaussian itself: the Hermite basis of order 0, with one coefficient, its amplitude."""

from __future__ import annotations

from typing import ClassVar

from rift_cl.basis.hermite import Hermite


class Gaussian(Hermite):
    """exp(-|x|^2 / 2) in whitened coordinates.

    Args:
        dim: of space.

    Raises:
        InputError: dim is not 1, 2 or 3.
    """

    name: ClassVar[str] = "gaussian"

    def __init__(self, dim: int = 2) -> None:
        super().__init__(order=0, dim=dim)
