"""X-ray strategy: splats of hardly any mass take over halves of others; their number stays.

Densities of X-rays add up, nothing hides anything: a splat of little mass takes over one half of a
splat whose image gradients are large. Mass m, mean and covariance of the two together stay what
they were, by shifts along the longest axis,

    m' = m / 2,    mean' = mean +- a s e,    s' = s sqrt(1 - a^2)  along e.

Hermite modes are derivatives of the Gaussian in units of its axes, and both halves keep the same
derivatives: a mode of order n along e is divided by (1 - a^2)^(n/2). So moments of the two together
are those of the splat before up to the third, as without modes; higher ones are not.

Relocation is seldom, on the host, in NumPy; what is random comes from (seed, step) alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.indices import graded
from rift_cl.errors import InputError, SettingError
from rift_cl.splat.orders import order_of
from rift_cl.train.per_view.quaternions import rotated
from rift_cl.train.ranges import check_number, check_whole
from rift_cl.train.strategy.protocol import StrategySettings, TrainingRun
from rift_cl.train.strategy.screen_statistics import ScreenStatistics, StatisticsStrategy

if TYPE_CHECKING:
    from rift_cl.splat.renderer import Frame, FrameGradients
    from rift_cl.train.parameters import Parameters

# Shift of the halves of a splat, in standard deviations.
_APART = 0.5


@dataclass(frozen=True)
class XraySettings(StrategySettings):
    """Relocate X-ray splats of hardly any mass into the halves of others.

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 100
    """Steps between two relocations."""
    first: int = 100
    """Step of the first relocation."""
    last: float = 0.7
    """Fraction of the run after which there are no relocations."""
    min_mass: float = 0.02
    """Mass up to which a splat is relocated, as a fraction of the mean mass."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_whole(self, "every", 1)
        check_whole(self, "first", 0)
        for name in ("last", "min_mass"):
            check_number(self, name, most=1)

    def begin(self, parameters: Parameters, run: TrainingRun) -> XrayStrategy:
        """The strategy of a run; see ``StrategySettings``."""
        if not parameters.density:
            raise SettingError(
                "TrainSettings",
                "strategy",
                "'xray' is for splats with densities, and these have opacities: use 'mcmc' or "
                "'default'",
            )
        return XrayStrategy(self, parameters, run)


class XrayStrategy(StatisticsStrategy):
    """Relocates splats by the image gradients gathered since the last relocation.

    Nothing walks at random and nothing is penalised.

    Args:
        settings: when, and what counts as hardly any mass.
        parameters: the splats that it begins with.
        run: the run that it serves.
    """

    def __init__(self, settings: XraySettings, parameters: Parameters, run: TrainingRun) -> None:
        super().__init__(run, ScreenStatistics(parameters.device, len(parameters)))
        self.settings = settings

    def after_step(
        self,
        parameters: Parameters,
        frame: Frame,
        gradients: FrameGradients,
        learning_rate: float,
    ) -> Parameters:
        """Relocated every few steps; see ``Strategy``."""
        settings, step = self.settings, parameters.step
        if step >= settings.last * self.run.steps:
            return parameters
        self.statistics.add(frame, gradients)
        if step >= settings.first and step % settings.every == 0:
            pull = self.statistics.host()[:, 0]
            parameters = relocate_densities(
                parameters, pull, min_mass=settings.min_mass, seed=self.run.seed
            )
            self.statistics.clear(len(parameters))
        return parameters


def relocate_densities(
    parameters: Parameters, pull: NDArray[np.float32], *, min_mass: float, seed: int
) -> Parameters:
    """Relocate splats of hardly any mass into the halves of others.

    Args:
        parameters: the splats; they are not changed.
        pull: (N,) sums of image gradients: splats are chosen for splitting in proportion to it.
        min_mass: fraction of the mean mass up to which a splat is relocated.
        seed: random seed, used with the step.

    Returns:
        As many splats, in which Adam's moments of all that were touched are zero. The mass of
        those that were relocated is lost.

    Raises:
        InputError: the splats have opacities; ``strategy.mcmc`` is for them.
    """
    if not parameters.density:
        raise InputError("relocate_densities: these splats have opacities, wanted densities")
    raw, first, second = parameters.host()
    random = np.random.default_rng((seed, parameters.step, 0xA12))
    masses = raw["logits"].astype(float) + raw["log_scales"].sum(axis=1, dtype=float)
    masses = np.exp(masses - masses.max())
    faded = masses <= min_mass * masses.mean()
    chance = np.where(faded | ~np.isfinite(pull), 0, pull.astype(float))
    places = np.flatnonzero(faded)[: np.count_nonzero(chance)]
    if places.size == 0:
        return parameters
    hosts = random.choice(len(parameters), places.size, replace=False, p=chance / chance.sum())
    for name in parameters.groups:
        raw[name][places] = raw[name][hosts]
        for moments in (first, second):
            moments[name][places] = moments[name][hosts] = 0
    _halve(raw, hosts, places)
    return parameters.replaced(raw, first, second)


def _halve(
    raw: dict[str, NDArray[np.float32]], hosts: NDArray[np.intp], places: NDArray[np.intp]
) -> None:
    """Make two halves of each host and the copy of it at the same index of ``places``."""
    rows = np.arange(hosts.size)
    longest = raw["log_scales"][hosts].argmax(axis=1)
    along = np.zeros((hosts.size, 3))
    along[rows, longest] = _APART * np.exp(raw["log_scales"][hosts, longest].astype(float))
    shift = rotated(raw["quats"][hosts].astype(float), along)
    shrink = np.float32(0.5 * np.log(1 - _APART**2))
    for halves, side in ((hosts, 1), (places, -1)):
        raw["means"][halves] += side * shift
        raw["log_scales"][halves, longest] += shrink
        # Half of the mass, in a volume that has shrunk.
        raw["logits"][halves] -= np.float32(np.log(2)) + shrink
        if "shape_modes" in raw:
            modes = raw["shape_modes"]
            powers = graded(order_of(modes.shape[1] + 1), 3)[1:, longest].T
            modes[halves] *= np.exp(-shrink * powers).astype(np.float32)
