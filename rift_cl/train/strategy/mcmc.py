"""Where splats come from and go to while they are trained: one protocol, three ways.

``McmcStrategy`` renews splats that have faded and lets faint ones walk at random (3DGS as MCMC);
``DefaultStrategy`` clones, splits and prunes (3DGS as it was at first); ``XrayStrategy`` renews
X-ray splats, whose densities add up. A trainer asks for penalties before each step of Adam and for
the splats to go on with after it, and keeps ``state`` in checkpoints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from numpy.typing import NDArray

from rift_cl.splat.frame import Frame, FrameGradients
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.strategy.default import DefaultStrategy, XrayStrategy, check_names
from rift_cl.train.strategy.relocation import grown, relocate

# A set of splats grows by no more than this at once.
_MOST_GROWTH = 1.0


class Strategy(Protocol):
    """What changes the set of splats between steps.

    Steps are counted by ``Parameters.step``: the first step of Adam makes it 1.
    """

    def drawing(self, drawing: SplatSettings) -> SplatSettings:
        """How splats have to be drawn, so that gradients have all that is needed."""

    def before_step(self, step: int) -> dict[str, float]:
        """The penalties of a step, as ``Parameters.update`` takes them; ``step`` are taken."""

    def after_step(
        self, parameters: Parameters, frame: Frame, gradients: FrameGradients, rate: float
    ) -> Parameters:
        """The splats to go on with.

        Args:
            parameters: the splats after the step, the same ones in the same order as in the frame.
            frame: what was drawn in the step.
            gradients: of its loss.
            rate: of the positions in the step.
        """

    def forecast(self, step: int, count: int) -> Iterator[tuple[int, int]]:
        """How many splats the steps to come will have, as far as that is known.

        Args:
            step: how many steps were taken.
            count: splats there are by now.

        Yields:
            Numbers of steps and of the splats that those have, up to the last step of the run.
        """

    def state(self) -> dict[str, NDArray[Any]]:
        """What a checkpoint must hold besides parameters and settings: host arrays by name."""

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from ``state``, with the parameters of the same checkpoint from the next step on.

        Raises:
            CheckpointError: it is none of this strategy.
        """


def strategy_of(
    settings: TrainSettings, parameters: Parameters, *, extent: float, finish: int
) -> Strategy:
    """The strategy of a run: for densities ``mcmc`` means ``XrayStrategy``.

    Args:
        settings: of the run.
        parameters: the splats it begins or goes on with.
        extent: of the scene.
        finish: the step with which noise and penalties end.

    Raises:
        InputError: the strategy cannot do with these splats.
    """
    if settings.strategy == "default":
        return DefaultStrategy(settings, parameters, extent=extent)
    if parameters.density:
        return XrayStrategy(settings, parameters)
    return McmcStrategy(settings, finish=finish)


class McmcStrategy:
    """Faded splats are renewed, faint ones walk at random; see ``strategy.relocation``.

    Args:
        settings: of the run.
        finish: the step with which noise and penalties end.
    """

    def __init__(self, settings: TrainSettings, *, finish: int) -> None:
        self.settings = settings
        self.finish = finish

    def drawing(self, drawing: SplatSettings) -> SplatSettings:
        """As it is."""
        return drawing

    def before_step(self, step: int) -> dict[str, float]:
        """Of opacities and scales, until the finish."""
        relocation, on = self.settings.relocation, step < self.finish
        return {
            "opacity_penalty": relocation.opacity_penalty if on else 0.0,
            "scale_penalty": relocation.scale_penalty if on else 0.0,
        }

    def after_step(
        self, parameters: Parameters, frame: Frame, gradients: FrameGradients, rate: float
    ) -> Parameters:
        """Relocated now and then, and shaken until the finish."""
        settings, step, relocation = self.settings, parameters.step, self.settings.relocation
        if step >= relocation.first and step % relocation.every == 0 and step < settings.steps:
            parameters = relocate(
                parameters,
                relocation,
                most=settings.splats,
                seed=settings.seed,
                growth=self._growth(step, len(parameters)),
            )
        if step <= self.finish:
            parameters.shake(relocation.noise * rate, settings.seed)
        return parameters

    def forecast(self, step: int, count: int) -> Iterator[tuple[int, int]]:
        """Growth follows from the number of splats alone; see ``Strategy``."""
        settings, every = self.settings, self.settings.relocation.every
        next_one = every * (max(step, settings.relocation.first - 1) // every + 1)
        for until in range(next_one, settings.steps, every):
            yield until - step, count
            step = until
            count += grown(count, self._growth(until, count), settings.splats)
        yield settings.steps - step, count

    def _growth(self, step: int, count: int) -> float:
        """The usual growth, or what a short run needs to have all its splats in time."""
        settings, relocation = self.settings, self.settings.relocation
        if step >= settings.steps * relocation.last:
            return 0.0
        left = max(1, int(settings.steps * relocation.full - step) // relocation.every + 1)
        needed = (settings.splats / count) ** (1 / left) - 1
        return max(relocation.growth, min(needed, _MOST_GROWTH)) if relocation.growth else 0.0

    def state(self) -> dict[str, NDArray[Any]]:
        """Nothing: all that is random comes from the seed and the step."""
        return {}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Check that there is nothing; see ``Strategy``."""
        check_names(state, self.state())
