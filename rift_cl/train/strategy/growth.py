"""A set of splats that grows by a share at each relocation: what strategies of relocation share.

Relocation is seldom and has no kernel: it is done on the host, in NumPy, and what is random in it
comes from (seed, step) alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.train.ranges import check_number, check_whole
from rift_cl.train.strategy.protocol import Penalties, Strategy, StrategySettings, TrainingRun

# A set of splats grows by no more than this share at once.
_MOST_GROWTH = 1.0

Raw = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class GrowthSettings(StrategySettings):
    """When splats are relocated, how their number grows, and what keeps them faint and small.

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 100
    """Steps between two relocations."""
    first: int = 500
    """Step of the first relocation."""
    last: float = 0.85
    """Fraction of the run after which the number of splats no longer grows."""
    growth: float = 0.05
    """Fraction by which the number of splats grows at each relocation, up to --splats; more
    where the run is too short for it (0 = the number stays)."""
    full: float = 0.5
    """Fraction of the run by which the number of splats should have grown to --splats."""
    min_opacity: float = 0.005
    """Opacity up to which a splat counts as transparent and is relocated."""
    opacity_penalty: float = 0.01
    """Weight of the mean opacity in the loss."""
    scale_penalty: float = 0.05
    """Weight of the mean scale in the loss, with scales as shares of the size of the scene."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_whole(self, "every", 1)
        check_whole(self, "first", 0)
        for name in ("last", "full", "min_opacity"):
            check_number(self, name, most=1)
        for name in ("growth", "opacity_penalty", "scale_penalty"):
            check_number(self, name)


class GrowthStrategy(Strategy):
    """Penalises opacities and scales until the cooldown, and grows the set of splats.

    Args:
        settings: when and by how much.
        run: the run that it serves.
    """

    def __init__(self, settings: GrowthSettings, run: TrainingRun) -> None:
        super().__init__(run)
        self._growing = settings

    def penalties(self, step: int) -> Penalties:
        """Of opacities and scales, until the cooldown."""
        settings = self._growing
        if step >= self.run.cooldown:
            return Penalties()
        return Penalties(settings.opacity_penalty, settings.scale_penalty / self.run.size)

    def relocates_at(self, step: int) -> bool:
        """Whether splats are relocated after so many steps."""
        first = self._growing.first
        return step >= first and step % self.spacing == 0 and step < self.run.steps

    @property
    def spacing(self) -> int:
        """Steps between two relocations."""
        return self._growing.every

    def forecast(self, step: int, count: int) -> Iterator[tuple[int, int]]:
        """Growth follows from the number of splats alone; see ``Strategy``."""
        run, every = self.run, self.spacing
        next_one = every * (max(step, self._growing.first - 1) // every + 1)
        for until in range(next_one, run.steps, every):
            yield until - step, count
            step = until
            count += grown(count, self.growth(until, count), run.splats)
        yield run.steps - step, count

    def growth(self, step: int, count: int) -> float:
        """The usual growth, or what a short run needs to have all its splats in time."""
        settings, run = self._growing, self.run
        if step >= run.steps * settings.last:
            return 0.0
        left = max(1, int(run.steps * settings.full - step) // self.spacing + 1)
        needed = (run.splats / count) ** (1 / left) - 1
        return max(settings.growth, min(needed, _MOST_GROWTH)) if settings.growth else 0.0


def grown(count: int, growth: float, most: int) -> int:
    """Number of splats that a relocation adds to ``count``."""
    return max(0, min(round(count * growth), most - count))


def take_over(
    raw: Raw,
    moments: tuple[Raw, Raw],
    *,
    hosts: NDArray[np.intp],
    places: NDArray[np.intp],
    added: int,
) -> None:
    """Make splats what others are, and begin anew with Adam's moments of both.

    Args:
        raw: all parameters by name, which are changed.
        moments: Adam's two moments of them, likewise.
        hosts: the others, one for each place.
        places: which splats become as they are.
        added: how many places lie behind the splats that there are.
    """
    touched = np.concatenate([places, hosts])
    for name, values in raw.items():
        raw[name] = _extended(values, added)
        raw[name][places] = raw[name][hosts]
        for moment in moments:
            moment[name] = _extended(moment[name], added)
            moment[name][touched] = 0


def _extended(array: NDArray[np.float32], more: int) -> NDArray[np.float32]:
    return np.concatenate([array, np.zeros((more, *array.shape[1:]), np.float32)])


def sigmoid(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Opacities by their logits."""
    return np.asarray(1 / (1 + np.exp(-x)))
