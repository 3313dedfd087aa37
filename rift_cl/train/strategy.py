"""Where splats come from and go to while they are trained: one protocol, three ways.

``MarkovChain`` renews splats that have faded and lets faint ones walk at random (3DGS as MCMC);
``Densify`` clones, splits and prunes (3DGS as it was at first); ``Halving`` renews X-ray splats,
whose densities add up. A trainer asks for penalties before each step of Adam and for the splats to
go on with after it, and keeps ``state`` in checkpoints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import CheckpointError, InputError
from rift_cl.splat.frame import Frame, FrameGradients
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.densify import densify, reset_opacities
from rift_cl.train.parameters import Parameters
from rift_cl.train.renewal import renew, renew_densities
from rift_cl.train.screen_statistics import ScreenStatistics
from rift_cl.train.settings import TrainSettings

# A set of splats grows by no more than this at once.
_MOST_GROWTH = 1.0
# A reset leaves opacities so many times as large as the faintest that stay.
_RESET = 2.0


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
    """The strategy of a run: for densities ``mcmc`` means ``Halving``.

    Args:
        settings: of the run.
        parameters: the splats it begins or goes on with.
        extent: of the scene.
        finish: the step with which noise and penalties end.

    Raises:
        InputError: the strategy cannot do with these splats.
    """
    if settings.strategy == "default":
        return Densify(settings, parameters, extent=extent)
    if parameters.density:
        return Halving(settings, parameters)
    return MarkovChain(settings, finish=finish)


class MarkovChain:
    """Faded splats are renewed, faint ones walk at random; see ``rift_cl.train.renewal``.

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
        renewal, on = self.settings.renewal, step < self.finish
        return {
            "opacity_penalty": renewal.opacity_penalty if on else 0.0,
            "scale_penalty": renewal.scale_penalty if on else 0.0,
        }

    def after_step(
        self, parameters: Parameters, frame: Frame, gradients: FrameGradients, rate: float
    ) -> Parameters:
        """Renewed now and then, and shaken until the finish."""
        settings, step, renewal = self.settings, parameters.step, self.settings.renewal
        if step >= renewal.first and step % renewal.every == 0 and step < settings.steps:
            parameters = renew(
                parameters,
                renewal,
                most=settings.splats,
                seed=settings.seed,
                growth=self._growth(step, len(parameters)),
            )
        if step <= self.finish:
            parameters.shake(renewal.noise * rate, settings.seed)
        return parameters

    def _growth(self, step: int, count: int) -> float:
        """The usual growth, or what a short run needs to have all its splats in time."""
        settings, renewal = self.settings, self.settings.renewal
        if step >= settings.steps * renewal.last:
            return 0.0
        left = max(1, int(settings.steps * renewal.full - step) // renewal.every + 1)
        needed = (settings.splats / count) ** (1 / left) - 1
        return max(renewal.growth, min(needed, _MOST_GROWTH)) if renewal.growth else 0.0

    def state(self) -> dict[str, NDArray[Any]]:
        """Nothing: all that is random comes from the seed and the step."""
        return {}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Check that there is nothing; see ``Strategy``."""
        _check_names(state, self.state())


class _Gathering:
    """What strategies have in common that go by statistics of the splats on the screen."""

    def __init__(self, settings: TrainSettings, seen: ScreenStatistics) -> None:
        self.settings = settings
        self._seen = seen

    def drawing(self, drawing: SplatSettings) -> SplatSettings:
        """With the magnitudes of screen gradients, if those are gathered."""
        return replace(drawing, absgrad=drawing.absgrad or self._seen.absgrad)

    def before_step(self, step: int) -> dict[str, float]:
        """None."""
        return dict.fromkeys(("opacity_penalty", "scale_penalty"), 0.0)

    def state(self) -> dict[str, NDArray[Any]]:
        """The statistics since they were last cleared."""
        return {"statistics": self._seen.host()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from them; see ``Strategy``."""
        _check_names(state, ("statistics",))
        self._seen.restore(np.asarray(state["statistics"]))


class Halving(_Gathering):
    """X-ray splats without mass take over halves of others; see ``renew_densities``.

    Their number stays, nothing walks at random and nothing is penalised.

    Args:
        settings: of the run.
        parameters: the splats it begins with, which have densities.
    """

    def __init__(self, settings: TrainSettings, parameters: Parameters) -> None:
        super().__init__(settings, ScreenStatistics(parameters.device, len(parameters)))

    def after_step(
        self, parameters: Parameters, frame: Frame, gradients: FrameGradients, rate: float
    ) -> Parameters:
        """Renewed now and then, by how strongly each splat was pulled at since the last time."""
        step, renewal = parameters.step, self.settings.renewal
        if step >= renewal.last * self.settings.steps:
            return parameters
        self._seen.add(frame, gradients)
        if step >= renewal.first and step % renewal.every == 0:
            pull = self._seen.host()[:, 0]
            parameters = renew_densities(parameters, renewal, pull, seed=self.settings.seed)
            self._seen.clear(len(parameters))
        return parameters


class Densify(_Gathering):
    """Splats are cloned, split and pruned; see ``rift_cl.train.densify``.

    Args:
        settings: of the run.
        parameters: the splats it begins with.
        extent: of the scene.

    Raises:
        InputError: the splats have densities, which no rule here knows.
    """

    def __init__(self, settings: TrainSettings, parameters: Parameters, *, extent: float) -> None:
        if parameters.density:
            raise InputError(
                "TrainSettings: strategy is 'default', which wants opacities, and these splats "
                "have densities: use 'mcmc'"
            )
        absgrad = settings.densification.absgrad
        seen = ScreenStatistics(parameters.device, len(parameters), absgrad=absgrad)
        super().__init__(settings, seen)
        self.extent = extent

    @property
    def reset_every(self) -> int:
        """Steps between two resets of opacities; 0 for none."""
        how, steps = self.settings.densification, self.settings.steps
        return max(round(how.reset * steps), how.reset_least) if how.reset else 0

    def after_step(
        self, parameters: Parameters, frame: Frame, gradients: FrameGradients, rate: float
    ) -> Parameters:
        """Densified now and then, and with opacities reset; see ``Strategy``."""
        settings, how = self.settings, self.settings.densification
        step, reset = parameters.step, self.reset_every
        if step >= how.last * settings.steps:
            return parameters
        self._seen.add(frame, gradients)
        if step > how.first * settings.steps and step % how.every == 0:
            parameters = densify(
                parameters,
                self._seen.host(),
                how,
                extent=self.extent,
                most=settings.splats,
                seed=settings.seed,
                prune_large=0 < reset < step,
            )
            self._seen.clear(len(parameters))
        if reset and step % reset == 0:
            parameters = reset_opacities(parameters, _RESET * how.faint)
        return parameters


def _check_names(state: Mapping[str, Any], wanted: Any) -> None:
    if set(state) != set(wanted):
        found, names = (" and ".join(sorted(x)) or "nothing" for x in (state, wanted))
        raise CheckpointError(f"the strategy's state holds {found}, wanted {names}")
