"""How often, and how well, linear coefficients are solved for in a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from rift_cl.errors import SettingError
from rift_cl.option_marks import Expert
from rift_cl.train.ranges import check_number, check_whole


@dataclass(frozen=True)
class SolveSettings:
    """Linear coefficients by ridge least squares, now and then, in place of Adam's steps.

    Few conjugate gradients serve best: begun where the coefficients are, they keep to what the
    pictures say loudly, and leave alone what only their noise and gaps would tell.

    Raises:
        InputError: a number is out of its range.
    """

    every: Annotated[int, arg(name="solve", prefix_name=False)] = 0
    """Steps between two least-squares solves for all densities and their modes, such as 100, with
    one before the first step and one after the last. Between them only positions and shapes are
    optimized (0 = none)."""
    views: Expert[int] = 64
    """Largest number of projections in a solve; of more, so many are drawn at random."""
    iterations: Expert[int] = 2
    """Conjugate gradient iterations of a solve."""
    # Below 1e-6 float32 does not hold the answer.
    ridge: Expert[float] = 1e-3
    """Weight of the squared coefficients, as a fraction of the mean squared norm of what one of
    them shows."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_whole(self, "every", 0)
        for name in ("views", "iterations"):
            check_whole(self, name, 1)
        check_number(self, "ridge")

    def check_heed(self, solves: bool) -> None:
        """Refuse solves to a trainer that does none, as that of splats that hide one another.

        Raises:
            InputError: there shall be solves.
        """
        if self.every and not solves:
            raise SettingError(
                self,
                "every",
                f"is {self.every}, which is for the densities of X-rays alone: leave it 0 for "
                "splats with opacities",
            )

    def due(self, step: int) -> bool:
        """Whether to solve before a step."""
        return self.every > 0 and step % self.every == 0
