"""MCMC strategy: transparent splats are relocated, faint ones may walk at random, the set grows.

3D Gaussian Splatting as Markov Chain Monte Carlo (Kheradmand et al. 2024): a transparent splat is
put on top of one that is drawn by chance, in proportion to its opacity. The picture must not jump,
so the k splats that now share a place get the opacity and scale with which they look together like
the one before:

    o' = 1 - (1 - o)^(1/k),    s' = s o / sum over i = 1..k, j = 0..i-1 of
                                         binomial(i-1, j) (-1)^j o'^(j+1) / sqrt(j+1).

Where densities are drawn as optical depths (``SplatSettings.activation``) depths add up: each of
the k gets one k-th, which is the same o', and keeps its scale, whatever its modes. That is exact.

The random walk is ``kernels/train/splat_noise.cl`` (``Parameters.shake``).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, SettingError
from rift_cl.train.ranges import check_number
from rift_cl.train.strategy.growth import (
    GrowthSettings,
    GrowthStrategy,
    grown,
    sigmoid,
    take_over,
)
from rift_cl.train.strategy.protocol import TrainingRun

if TYPE_CHECKING:
    from rift_cl.splat.renderer import Frame, FrameGradients
    from rift_cl.train.parameters import Parameters

# More splats than this in one place share it like so many.
_MOST_IN_PLACE = 51
_OPACITY_EDGE = 1e-6

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class McmcSettings(GrowthSettings):
    """Relocate transparent splats, with penalties and, if asked for, random walks (3DGS as MCMC).

    Raises:
        InputError: a number is out of its range.
    """

    noise: float = 0.0
    """Step of the random walk of faint splats, as a multiple of the positions' learning rate; 5e5
    in Kheradmand et al. 2024 (0 = none)."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        super().__post_init__()
        check_number(self, "noise")

    def begin(self, parameters: Parameters, run: TrainingRun) -> McmcStrategy:
        """The strategy of a run; see ``StrategySettings``."""
        if parameters.density:
            raise SettingError(
                "TrainSettings",
                "strategy",
                "'mcmc' is for splats with opacities, and these have densities: use 'xray'",
            )
        return McmcStrategy(self, run)


class McmcStrategy(GrowthStrategy):
    """Relocates transparent splats, and moves faint ones at random if that is asked for.

    Args:
        settings: when, and what counts as transparent.
        run: the run that it serves.
    """

    wants_frame = False

    def __init__(self, settings: McmcSettings, run: TrainingRun) -> None:
        super().__init__(settings, run)
        self.settings = settings

    def after_step(
        self,
        parameters: Parameters,
        frame: Frame,
        gradients: FrameGradients,
        learning_rate: float,
    ) -> Parameters:
        """Relocated every few steps, and moved at random until the cooldown if that is wanted."""
        settings, run, step = self.settings, self.run, parameters.step
        if self.relocates_at(step):
            parameters = relocate(
                parameters,
                min_opacity=settings.min_opacity,
                most=run.splats,
                seed=run.seed,
                growth=self.growth(step, len(parameters)),
            )
        if settings.noise and step <= run.cooldown:
            parameters.shake(settings.noise * learning_rate, run.seed)
        return parameters


def relocate(
    parameters: Parameters, *, min_opacity: float, most: int, seed: int, growth: float
) -> Parameters:
    """Relocate transparent splats and add new ones.

    Args:
        parameters: the splats; they are not changed.
        min_opacity: opacity up to which a splat counts as transparent.
        most: splats that there may be.
        seed: random seed, used with the step.
        growth: fraction by which their number grows, up to ``most``.

    Returns:
        Parameters in which Adam's moments of all splats that were touched are zero.

    Raises:
        InputError: the splats have densities; ``strategy.xray`` is for them.
    """
    if parameters.density:
        raise InputError("relocate: these splats have densities, wanted opacities")
    raw, first, second = parameters.host()
    random = np.random.default_rng((seed, parameters.step, 0xA11))
    opacities = sigmoid(raw["logits"].astype(float))
    faded = np.flatnonzero(opacities <= min_opacity)
    alive = np.flatnonzero(opacities > min_opacity)
    if alive.size == 0:
        return parameters
    added = grown(len(parameters), growth, most)
    chance = opacities[alive] / opacities[alive].sum()
    chosen = alive[random.choice(alive.size, faded.size + added, p=chance)]
    shared = np.bincount(chosen, minlength=len(parameters))
    _share(raw, opacities, shared, depths=parameters.amplitude)
    places = np.concatenate([faded, np.arange(len(parameters), len(parameters) + added)])
    take_over(raw, (first, second), hosts=chosen, places=places, added=added)
    return parameters.replaced(raw, first, second)


def _share(
    raw: dict[str, NDArray[np.float32]],
    opacities: Floats,
    shared: NDArray[np.int64],
    *,
    depths: bool,
) -> None:
    """Make splats share their place with as many others as fell on it."""
    hosts = np.flatnonzero(shared)
    count = np.minimum(shared[hosts] + 1, _MOST_IN_PLACE)
    opacity = opacities[hosts]
    each = 1 - (1 - opacity) ** (1 / count)
    if not depths:
        scale = opacity / np.array([_overlap(o, k) for o, k in zip(each, count, strict=True)])
        raw["log_scales"][hosts] += np.log(scale)[:, None]
    each = np.clip(each, _OPACITY_EDGE, 1 - _OPACITY_EDGE)
    raw["logits"][hosts] = np.log(each / (1 - each))


def _overlap(opacity: float, count: int) -> float:
    """The double sum above: what ``count`` splats in one place hide on the whole."""
    terms = (
        comb(i - 1, j) * (-1) ** j * opacity ** (j + 1) / np.sqrt(j + 1)
        for i in range(1, count + 1)
        for j in range(i)
    )
    return float(sum(terms))
