"""Strategies that gather, frame by frame, how strongly each splat is pulled at on the screen.

``DefaultStrategy`` clones, splits and prunes by it, ``XrayStrategy`` renews X-ray splats; both keep
what they have gathered in checkpoints. ``rift_cl.train.strategy.mcmc`` has the protocol, and
chooses.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import CheckpointError, InputError
from rift_cl.splat.frame import Frame, FrameGradients
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.strategy.densify import densify, reset_opacities
from rift_cl.train.strategy.relocation import relocate_densities
from rift_cl.train.strategy.screen_statistics import ScreenStatistics

# A reset leaves opacities so many times as large as the faintest that stay.
_RESET = 2.0


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

    def forecast(self, step: int, count: int) -> Iterator[tuple[int, int]]:
        """As many as there are: what is split and pruned hangs on the pictures."""
        yield self.settings.steps - step, count

    def state(self) -> dict[str, NDArray[Any]]:
        """The statistics since they were last cleared."""
        return {"statistics": self._seen.host()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from them; see ``Strategy``."""
        check_names(state, ("statistics",))
        self._seen.restore(np.asarray(state["statistics"]))


class XrayStrategy(_Gathering):
    """X-ray splats without mass take over halves of others; see ``relocate_densities``.

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
        """Relocated now and then, by how strongly each splat was pulled at since the last time."""
        step, relocation = parameters.step, self.settings.relocation
        if step >= relocation.last * self.settings.steps:
            return parameters
        self._seen.add(frame, gradients)
        if step >= relocation.first and step % relocation.every == 0:
            pull = self._seen.host()[:, 0]
            parameters = relocate_densities(parameters, relocation, pull, seed=self.settings.seed)
            self._seen.clear(len(parameters))
        return parameters


class DefaultStrategy(_Gathering):
    """Splats are cloned, split and pruned; see ``rift_cl.train.strategy.densify``.

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


def check_names(state: Mapping[str, Any], wanted: Any) -> None:
    """Check that a state holds what a strategy keeps.

    Raises:
        CheckpointError: it does not.
    """
    if set(state) != set(wanted):
        found, names = (" and ".join(sorted(x)) or "nothing" for x in (state, wanted))
        raise CheckpointError(f"the strategy's state holds {found}, wanted {names}")
