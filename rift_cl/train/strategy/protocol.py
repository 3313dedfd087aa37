"""What a strategy is: it adds, moves and removes splats while they are trained.

A strategy comes as two classes. Its settings are a frozen dataclass (``StrategySettings``), which
``TrainSettings.strategy`` holds and which is saved with a run; ``begin`` makes of them the object
(``Strategy``) that the trainer calls in each step. ``register_strategy`` gives the settings a name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from numpy.typing import NDArray

from rift_cl.errors import CheckpointError, InputError

if TYPE_CHECKING:
    from rift_cl.cl.array import DeviceArray
    from rift_cl.splat.renderer import Frame, FrameGradients
    from rift_cl.splat.settings import SplatSettings
    from rift_cl.train.parameters import Parameters


@dataclass(frozen=True)
class TrainingRun:
    """What a strategy knows of the run that it serves.

    Args:
        steps: optimization steps of the whole run.
        splats: most splats that there may be.
        seed: random seed; draw from (seed, step), so that a resumed run repeats the same bits.
        extent: the length that positions' learning rates are measured in: how far cameras spread,
            or a few reaches of the volume of an X-ray scan.
        cooldown: the step with which the cooldown begins.
        size: the length that scales are measured in: about how far cameras are from what they see.
    """

    steps: int
    splats: int
    seed: int
    extent: float
    cooldown: int
    size: float = 1.0


# How alike two names are of which one is the other misspelt.
_NEARLY = 0.85

S = TypeVar("S", bound="StrategySettings")


class StrategySettings(ABC):
    """Base of the settings of strategies, which are frozen dataclasses."""

    @abstractmethod
    def begin(self, parameters: Parameters, run: TrainingRun) -> Strategy:
        """The strategy of a run.

        Args:
            parameters: the splats that the run begins or goes on with.
            run: the run.

        Raises:
            InputError: the strategy cannot serve splats of this kind.
        """

    def decided(self: S) -> S:
        """These settings, with a value for what was left open."""
        return self


class Penalties(NamedTuple):
    """Terms that a strategy adds to the loss of a step.

    Args:
        opacity: weight of the mean opacity.
        scale: weight of the mean scale.
    """

    opacity: float = 0.0
    scale: float = 0.0


class Strategy:
    """Hooks that the trainer calls; each does nothing unless a strategy overrides it.

    Steps are counted by ``Parameters.step``: the first step of Adam makes it 1.

    Args:
        run: the run that the strategy serves.
    """

    # Whether ``after_step`` reads ``gradients.sh``, for which memory and time are spent then.
    wants_sh_gradient = False
    # Whether ``after_step`` reads ``frame``; what that holds is given up earlier otherwise.
    wants_frame = True

    def __init__(self, run: TrainingRun) -> None:
        self.run = run

    def __init_subclass__(cls, **more: Any) -> None:
        """Refuse a hook whose name is misspelt, which nobody would ever call.

        Raises:
            InputError: a method is called nearly as a hook is.
        """
        super().__init_subclass__(**more)
        hooks = [name for name in vars(Strategy) if not name.startswith("_")]
        for name, own in vars(cls).items():
            near = [] if name in hooks else get_close_matches(name, hooks, 1, _NEARLY)
            if near and callable(own):
                raise InputError(
                    f"{cls.__name__}.{name}: a strategy has no hook of this name; did you mean "
                    f"{near[0]}?"
                )

    def render_settings(self, settings: SplatSettings) -> SplatSettings:
        """How frames have to be rendered, so that their gradients hold all that is needed."""
        return settings

    def penalties(self, step: int) -> Penalties:
        """The penalties in the loss of the step after ``step`` steps."""
        return Penalties()

    def looks_at(self, step: int) -> bool:
        """Whether ``look`` is called in the step after ``step`` steps."""
        return False

    def look(
        self,
        frame: Frame,
        image: DeviceArray,
        target: DeviceArray,
        weights: DeviceArray | None,
    ) -> None:
        """Called with what was rendered, before its gradient is made.

        Args:
            frame: what was rendered in the step, whatever ``wants_frame`` says.
            image: its image as it is compared, with the exposure of the view, (height, width, D).
            target: the training image, (height, width, C); channels behind C are not compared.
            weights: of the pixels, (height, width); None where all are 1.
        """

    def after_step(
        self,
        parameters: Parameters,
        frame: Frame,
        gradients: FrameGradients,
        learning_rate: float,
    ) -> Parameters:
        """The splats to go on with, after a step of Adam.

        Args:
            parameters: the splats after the step, in the same order as in the frame.
            frame: what was rendered in the step; it holds nothing where the class clears
                ``wants_frame``.
            gradients: of its loss, without the penalties, by what was drawn: scales and opacities,
                not their logarithms and logits. ``gradients.sh`` is None unless the class sets
                ``wants_sh_gradient``: coefficients take their step of Adam as it is made.
            learning_rate: of the positions in the step, in units of the scene.

        Returns:
            These parameters, or others in their place (``Parameters.replaced``), at the same step.
        """
        return parameters

    def forecast(self, step: int, count: int) -> Iterator[tuple[int, int]]:
        """How many splats the remaining steps will have, as far as that is known in advance.

        Args:
            step: how many steps were taken.
            count: splats that there are now.

        Yields:
            Numbers of steps and of the splats that those have, up to the last step of the run.
        """
        yield self.run.steps - step, count

    def state(self) -> dict[str, NDArray[Any]]:
        """What a checkpoint must hold besides parameters and settings: host arrays by name.

        All that changes from step to step belongs here, such as a count in an attribute: a
        resumed run begins with the attributes of ``begin`` and what ``restore`` makes of this.
        """
        return {}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from ``state``, with the parameters of the same checkpoint from the next step on.

        Raises:
            CheckpointError: the state is not one of this strategy.
        """
        check_names(state, self.state())


def check_names(state: Mapping[str, Any], wanted: Any) -> None:
    """Check that a state holds exactly the arrays that a strategy keeps.

    Raises:
        CheckpointError: it does not.
    """
    if set(state) != set(wanted):
        found, names = (" and ".join(sorted(x)) or "nothing" for x in (state, wanted))
        raise CheckpointError(f"the strategy's state holds {found}, wanted {names}")
