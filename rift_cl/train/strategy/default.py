"""Default strategy: splats are cloned and split where gradients are large, and pruned elsewhere.

The densification of 3D Gaussian Splatting (Kerbl et al. 2023) as gsplat 1.5 does it. Of the splats
whose mean gradient on the screen is large, a small one leaves a copy of itself in its place, and a
large one gives way to two that are drawn from its own Gaussian, with scales 1.6 times smaller.
Transparent splats are removed, and later those that have become too large. Copies and halves keep
the modes and lobes of the splat that they come from, in coordinates of their own.

The original counts steps of a run of 30,000: the first densification at 500, the last before
15,000, opacities reset every 3,000. What follows from the course of the run is a fraction of its
steps here, so that 30,000 give the original's numbers. What follows from how fast Adam moves is
not: a mean gradient wants as many images in a short run, and an opacity takes as many steps to come
back after a reset.

Densification is seldom, on the host, in NumPy; what is random comes from (seed, step) alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import SettingError, checked_flag
from rift_cl.option_marks import Auto
from rift_cl.train.per_view.quaternions import rotated
from rift_cl.train.ranges import check_number, check_whole
from rift_cl.train.strategy.protocol import StrategySettings, TrainingRun
from rift_cl.train.strategy.screen_statistics import ScreenStatistics, StatisticsStrategy

if TYPE_CHECKING:
    from rift_cl.splat.renderer import Frame, FrameGradients
    from rift_cl.splat.settings import SplatSettings
    from rift_cl.train.parameters import Parameters

_SPLIT_SHRINK = 1.6
# ln of the largest scale that is drawn; see kernels/splat/splat_activate.cl.
_MOST_LOG = 30.0
# A reset leaves opacities so many times as large as the faintest that stay.
_RESET = 2.0

Floats = NDArray[np.float64]
Chosen = NDArray[np.bool_]
Raw = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class DefaultSettings(StrategySettings):
    """Clone, split and prune (3DGS, Kerbl et al. 2023; constants of gsplat 1.5).

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 100
    """Steps between two densifications, over which gradients are averaged."""
    first: float = 1 / 60
    """Fraction of the run before the first densification."""
    last: float = 0.5
    """Fraction of the run after which there are no densifications and no resets."""
    grow_gradient: Auto[float] = None
    """Mean screen-space gradient above which a splat is cloned or split, with image coordinates
    from -1 to 1. Default: 2e-4, or 8e-4 with absgrad."""
    absgrad: bool = False
    """Densify by sums of absolute gradients over pixels, which do not cancel (AbsGS)."""
    split_scale: float = 0.01
    """Scale above which a splat is split, not cloned, as a fraction of the scene's extent."""
    prune_opacity: float = 0.005
    """Opacity below which splats are removed; a reset leaves no opacity above twice that."""
    prune_scale: float = 0.1
    """Scale above which splats are removed after the first reset, as a fraction of the scene's
    extent."""
    prune_screen_size: Auto[float] = None
    """Radius on the screen above which splats are removed after the first reset, as a fraction of
    the image's larger side. Default: never."""
    reset: float = 0.1
    """Fraction of the run between two resets of opacities (0 = none)."""
    min_reset: int = 500
    """Fewest steps between two resets."""
    revised_opacity: bool = False
    """Give the two splats in place of one the opacity 1 - sqrt(1 - o), with which they occlude
    together what one did (Rota Bulo et al. 2024)."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        for name in ("absgrad", "revised_opacity"):
            checked_flag("DefaultSettings", name, getattr(self, name))
        for name in ("every", "min_reset"):
            check_whole(self, name, 1)
        for name in ("first", "last", "reset"):
            check_number(self, name, most=1)
        for name in ("grow_gradient", "prune_screen_size"):
            if getattr(self, name) is not None:
                check_number(self, name, above=True)
        for name in ("split_scale", "prune_scale"):
            check_number(self, name, above=True)
        check_number(self, "prune_opacity", most=0.25, above=True)
        if self.split_scale > self.prune_scale:
            raise SettingError(
                self,
                "split_scale",
                f"is {self.split_scale!r} and prune_scale is {self.prune_scale!r}, wanted "
                "split_scale <= prune_scale",
            )

    @property
    def threshold(self) -> float:
        """The mean gradient above which a splat is cloned or split."""
        return self.grow_gradient or (8e-4 if self.absgrad else 2e-4)

    def decided(self) -> DefaultSettings:
        """These settings, with a value for what was left open."""
        return replace(self, grow_gradient=self.threshold)

    def begin(self, parameters: Parameters, run: TrainingRun) -> DefaultStrategy:
        """The strategy of a run; see ``StrategySettings``."""
        if parameters.density:
            raise SettingError(
                "TrainSettings",
                "strategy",
                "'default' is for splats with opacities, and these have densities: use 'xray'",
            )
        return DefaultStrategy(self, parameters, run)


class DefaultStrategy(StatisticsStrategy):
    """Clones, splits and prunes splats, and resets their opacities.

    Args:
        settings: when, and from which gradients, scales and opacities on.
        parameters: the splats that it begins with.
        run: the run that it serves.
    """

    def __init__(self, settings: DefaultSettings, parameters: Parameters, run: TrainingRun) -> None:
        device, count = parameters.device, len(parameters)
        super().__init__(run, ScreenStatistics(device, count, absgrad=settings.absgrad))
        self.settings = settings

    def render_settings(self, settings: SplatSettings) -> SplatSettings:
        """With sums of absolute screen gradients, if those are gathered."""
        return replace(settings, absgrad=settings.absgrad or self.settings.absgrad)

    @property
    def reset_every(self) -> int:
        """Steps between two resets of opacities; 0 for none."""
        settings = self.settings
        if not settings.reset:
            return 0
        return max(round(settings.reset * self.run.steps), settings.min_reset)

    def after_step(
        self,
        parameters: Parameters,
        frame: Frame,
        gradients: FrameGradients,
        learning_rate: float,
    ) -> Parameters:
        """Densified every few steps, and with opacities reset; see ``Strategy``."""
        settings, run, step, reset = self.settings, self.run, parameters.step, self.reset_every
        if step >= settings.last * run.steps:
            return parameters
        self.statistics.add(frame, gradients)
        if step > settings.first * run.steps and step % settings.every == 0:
            parameters = densify(
                parameters,
                self.statistics.host(),
                settings,
                extent=run.extent,
                most=run.splats,
                seed=run.seed,
                prune_large=0 < reset < step,
            )
            self.statistics.clear(len(parameters))
        if reset and step % reset == 0:
            parameters = reset_opacities(parameters, _RESET * settings.prune_opacity)
        return parameters


@dataclass(frozen=True)
class _Fates:
    """What becomes of each splat; indices in ascending order.

    Args:
        kept: stay as they are.
        cloned: of those, the ones that leave a copy.
        split: give way to two.
    """

    kept: NDArray[np.intp]
    cloned: NDArray[np.intp]
    split: NDArray[np.intp]


def densify(
    parameters: Parameters,
    statistics: NDArray[np.float32],
    settings: DefaultSettings,
    *,
    extent: float,
    most: int,
    seed: int,
    prune_large: bool,
) -> Parameters:
    """Clone, split and prune.

    Args:
        parameters: N splats; they are not changed.
        statistics: (N, 3), what ``ScreenStatistics`` gathered since the last time.
        settings: from which gradients, scales and opacities on.
        extent: of the scene, in its units.
        most: splats that there may be: where there is no room for all, those with the largest
            mean gradients are cloned or split.
        seed: random seed, used with the step.
        prune_large: whether splats that are too large are pruned.

    Returns:
        The splats that stay in their order and with Adam's moments, then the copies, then both
        halves of those that were split, with moments of zero. Where nothing would stay, the
        parameters as they were.
    """
    raw, first, second = parameters.host()
    fates = _fates(raw, statistics, settings, extent=extent, most=most, prune_large=prune_large)
    if fates.kept.size + fates.split.size == 0:
        return parameters
    order = np.concatenate([fates.kept, fates.cloned, fates.split, fates.split])
    random = np.random.default_rng((seed, parameters.step, 0xDE5))
    if settings.revised_opacity:
        doubled = np.concatenate([fates.cloned, fates.split])
        raw["logits"][doubled] = _shared_logits(raw["logits"][doubled])
    after = {name: array[order] for name, array in raw.items()}
    halves = order.size - 2 * fates.split.size
    after["means"][halves:] += _samples(raw, fates.split, random)
    after["log_scales"][halves:] -= np.float32(log(_SPLIT_SHRINK))
    for group in (first, second):
        for name in raw:
            group[name] = group[name][order]
            group[name][fates.kept.size :] = 0
    return parameters.replaced(after, first, second)


def reset_opacities(parameters: Parameters, most: float) -> Parameters:
    """Splats of which none has an opacity above ``most``, and Adam's moments of logits are zero."""
    raw, first, second = parameters.host()
    raw["logits"] = np.minimum(raw["logits"], np.float32(_logit(most)))
    for moments in (first, second):
        moments["logits"] = np.zeros_like(moments["logits"])
    return parameters.replaced(raw, first, second)


def _fates(
    raw: Raw,
    statistics: NDArray[np.float32],
    settings: DefaultSettings,
    *,
    extent: float,
    most: int,
    prune_large: bool,
) -> _Fates:
    gradient = statistics[:, 0].astype(float) / np.maximum(statistics[:, 1], 1)
    # Sizes and opacities are compared as they are trained, where nothing overflows.
    size = raw["log_scales"].max(axis=1).astype(float) - log(extent)
    doomed = ~_usable(raw) | (raw["logits"] < _logit(settings.prune_opacity))
    too_large = np.zeros(len(size), bool)
    if prune_large:
        too_large = size > log(settings.prune_scale)
        if settings.prune_screen_size is not None:
            doomed |= statistics[:, 2] > settings.prune_screen_size
    pulled = np.isfinite(gradient) & (gradient > settings.threshold) & ~doomed
    small = size <= log(settings.split_scale)
    # One that is too large may be split, if its halves are not too large as well.
    wide = pulled & ~small
    if prune_large:
        wide &= size - log(_SPLIT_SHRINK) <= log(settings.prune_scale)
    pruned = doomed | too_large
    room = most - int(np.count_nonzero(~pruned))
    grown = _strongest(gradient, pulled & small | wide, 1 + pruned, room)
    split = grown & ~small
    return _Fates(
        np.flatnonzero(~pruned & ~split), np.flatnonzero(grown & small), np.flatnonzero(split)
    )


def _usable(raw: Raw) -> Chosen:
    """Splats with finite parameters and a nonzero quaternion."""
    usable = np.asarray(raw["quats"].any(axis=1))
    for array in raw.values():
        usable &= np.isfinite(array).reshape(len(usable), -1).all(axis=1)
    return usable


def _strongest(gradient: Floats, wanted: Chosen, cost: NDArray[np.int64], room: int) -> Chosen:
    """Those of the wanted with the largest gradients, as many as there is room for.

    Args:
        gradient: (N,) finite where wanted.
        wanted: (N,).
        cost: (N,) by how much the set grows for each.
        room: by how much it may grow.
    """
    candidates = np.flatnonzero(wanted)
    ranked = candidates[np.argsort(-gradient[candidates], kind="stable")]
    chosen = np.zeros(len(wanted), bool)
    chosen[ranked[np.cumsum(cost[ranked]) <= room]] = True
    return chosen


def _samples(raw: Raw, split: NDArray[np.intp], random: np.random.Generator) -> Floats:
    """(2S, 3) offsets of the halves of S splats, sampled from each splat's Gaussian."""
    twice = np.concatenate([split, split])
    scales = np.exp(np.minimum(raw["log_scales"][twice].astype(float), _MOST_LOG))
    along = scales * random.standard_normal(scales.shape)
    return rotated(raw["quats"][twice].astype(float), along)


def _shared_logits(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logits of 1 - sqrt(1 - o): of two splats in one place that hide together what one did."""
    log_root = -0.5 * np.logaddexp(0, logits.astype(float))
    return np.asarray(np.log(-np.expm1(log_root)) - log_root, np.float32)


def _logit(opacity: float) -> float:
    return log(opacity / (1 - opacity))
