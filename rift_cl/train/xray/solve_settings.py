"""How often, and how well, linear coefficients are solved for in a fit."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.errors import InputError
from rift_cl.train.ranges import check_number, check_whole


@dataclass(frozen=True)
class SolveSettings:
    """Linear coefficients by ridge least squares, now and then, in place of Adam's steps.

    Few conjugate gradients serve best: begun where the coefficients are, they keep to what the
    pictures say loudly, and leave alone what only their noise and gaps would tell.

    Args:
        every: steps between two solves, the first before the first step, and one after the last;
            0 for none.
        views: most pictures that a solve looks at; where there are more, they are drawn by chance
            from the seed and the step.
        iterations: conjugate gradients of a solve.
        ridge: weight of the squared coefficients, as a share of the mean squared norm of what one
            of them shows. Below 1e-6 float32 does not hold the answer.

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 0
    views: int = 64
    iterations: int = 2
    ridge: float = 1e-3

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
            raise InputError(
                f"TrainSettings: solve.every is {self.every}, which is for the densities of X-rays "
                "alone: leave it 0 for splats with opacities"
            )

    def due(self, step: int) -> bool:
        """Whether to solve before a step."""
        return self.every > 0 and step % self.every == 0
