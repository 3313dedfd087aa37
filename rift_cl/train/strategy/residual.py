"""Residual strategy: splats that the images hardly need are moved to where the residual is largest.

What a splat shows of an image is the sum over pixels of alpha times transmittance. Summed over some
training views, that says how many pixels a splat makes up, and, weighted with the residual, how
much of the error lies on it (error-based densification: Rota Bulo et al. 2024, "Revising
Densification in Gaussian Splatting"; contributions as in LightGaussian, Fan et al. 2024, and
Mini-Splatting, Fang and Wang 2024). Splats that make up next to nothing, because they are
transparent, hidden or tiny, take over one half of a splat drawn in proportion to its share of the
residual. Halves lie apart along the longest axis and are shorter there,

    mean' = mean +- a s e,    s' = b s  along e,

so that two splats see gradients of their own at once, where two in one place would see the same.

Nothing has to be kept faint to be found, as relocation by opacity needs it: the penalty of
opacities is small. ``kernels/train/residual_image.cl`` and ``residual_statistics.cl`` say what is
computed; ``rift_cl.reference.training`` has their twins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import CheckpointError, InputError, SettingError
from rift_cl.train.per_view.quaternions import rotated
from rift_cl.train.ranges import check_number, check_whole
from rift_cl.train.strategy.growth import (
    GrowthSettings,
    GrowthStrategy,
    Raw,
    grown,
    sigmoid,
    take_over,
)
from rift_cl.train.strategy.protocol import TrainingRun, check_names

if TYPE_CHECKING:
    from rift_cl.cl.array import DeviceArray
    from rift_cl.cl.device import Device
    from rift_cl.splat.renderer import Frame, FrameGradients
    from rift_cl.train.parameters import Parameters

# Shift of the halves of a splat in standard deviations, and what is left of these along it.
_APART, _SHRINK = 0.5, 0.6
# Sum of the residual shown, of the pixels made up, and number of views.
_COLUMNS = 3


@dataclass(frozen=True)
class ResidualSettings(GrowthSettings):
    """Move splats that the images hardly need to where the residual is largest.

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 50
    """Fewest steps between two relocations."""
    relocations: int = 50
    """Largest number of relocations in a run: they are further apart in a long one."""
    first: int = 100
    """Step of the first relocation."""
    last: float = 0.85
    """Fraction of the run after which splats are no longer relocated, and their number stays."""
    opacity_penalty: float = 0.0
    """Weight of the mean opacity in the loss."""
    scale_penalty: float = 0.2
    """Weight of the mean scale in the loss, with scales as shares of the size of the scene."""
    views: int = 20
    """Training views before a relocation that say what each splat contributes: those of so many
    steps, or of all since the last relocation where these are fewer."""
    min_contribution: float = 0.4
    """Contribution up to which a splat is relocated at the start, as a fraction of the median
    contribution: how many pixels it makes up in a view that looks at it."""
    min_contribution_last: float = 0.0
    """The same at the last relocation; in between it changes in proportion to the steps. Early
    on much is in a wrong place, and later on what is faint shows something."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        super().__post_init__()
        check_whole(self, "relocations", 1)
        check_whole(self, "views", 1)
        for name in ("min_contribution", "min_contribution_last"):
            check_number(self, name, most=1)

    def begin(self, parameters: Parameters, run: TrainingRun) -> ResidualStrategy:
        """The strategy of a run; see ``StrategySettings``."""
        if parameters.density:
            raise SettingError(
                "TrainSettings",
                "strategy",
                "'residual' is for splats with opacities, and these have densities: use 'xray'",
            )
        return ResidualStrategy(self, parameters, run)


class Contributions:
    """What each of N splats shows of some views and of their residuals, on the device.

    Args:
        device: where the splats are.
        count: N.
    """

    def __init__(self, device: Device, count: int) -> None:
        self._device = device
        self._table: DeviceArray = device.zeros((count, _COLUMNS))

    def clear(self, count: int) -> None:
        """Begin again with ``count`` splats and no views."""
        self._table = self._device.zeros((count, _COLUMNS))

    def add(
        self, frame: Frame, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None
    ) -> None:
        """Add what one frame says; nothing waits for the device.

        Args:
            frame: what was drawn, of these splats in this order.
            image: the frame's image as it is compared, (height, width, D).
            target: what it shall be, (height, width, C) with C <= D.
            weights: of the pixels, (height, width); None where all are 1.

        Raises:
            InputError: the image has a single channel, or the frame other splats.
        """
        # Here, so that the help of a fit, which shows these settings, loads no renderer.
        from rift_cl.splat.raster_pass import draw_grad

        device, (height, width, channels) = self._device, image.shape
        if channels < 2:
            raise InputError(
                "the strategy 'residual' wants images of 2 channels or more, and these have 1: use "
                "'mcmc'"
            )
        if len(frame.splats) != len(self._table):
            raise InputError(
                f"the frame has {len(frame.splats)} splats, contributions are of {len(self._table)}"
            )
        residual = device.empty(image.shape)
        device.launch(
            "residual_image",
            (height * width,),
            image=image,
            target=target,
            # A kernel without weights still takes an array in their place.
            weights=target if weights is None else weights,
            residual=residual,
            pixels=height * width,
            CHANNELS=target.shape[2],
            IMAGE_CHANNELS=channels,
            WEIGHTED=int(weights is not None),
        )
        sums = draw_grad(device, frame.raster_pass, residual)
        device.launch(
            "residual_statistics",
            (len(self._table),),
            sums=sums,
            culled=frame.projection.culled,
            statistics=self._table,
            width=sums.shape[1],
            first=frame.raster_pass.screen.first_feature,
            count=len(self._table),
        )

    def host(self) -> NDArray[np.float32]:
        """(N, 3): sums of the residual shown and of the pixels made up, and views."""
        return self._device.get(self._table)

    def restore(self, table: NDArray[np.float32]) -> None:
        """Go on from what ``host`` returned.

        Raises:
            CheckpointError: it is no such table.
        """
        if table.ndim != 2 or table.shape[1] != _COLUMNS:
            raise CheckpointError(f"contributions have shape {table.shape}, wanted (N, {_COLUMNS})")
        if not np.isfinite(table).all():
            raise CheckpointError("contributions hold numbers that are not finite")
        self._table = self._device.array(table)


class ResidualStrategy(GrowthStrategy):
    """Moves splats that the images hardly need to where the residual is largest.

    Args:
        settings: when, and what counts as hardly needed.
        parameters: the splats that it begins with.
        run: the run that it serves.
    """

    wants_frame = False

    def __init__(
        self, settings: ResidualSettings, parameters: Parameters, run: TrainingRun
    ) -> None:
        super().__init__(settings, run)
        self.settings = settings
        self.contributions = Contributions(parameters.device, len(parameters))

    @property
    def spacing(self) -> int:
        """As many steps as leave a long run no more relocations than there may be."""
        return max(self.settings.every, ceil(self.run.steps / self.settings.relocations))

    def min_contribution(self, step: int) -> float:
        """Contribution up to which a splat is relocated at a step, as a fraction of the median."""
        settings = self.settings
        way = min(1.0, step / max(1.0, settings.last * self.run.steps))
        return (1 - way) * settings.min_contribution + way * settings.min_contribution_last

    def relocates_at(self, step: int) -> bool:
        """Not beyond a fraction of the run either."""
        return super().relocates_at(step) and step < self.settings.last * self.run.steps

    def looks_at(self, step: int) -> bool:
        """At the last views before each relocation; see ``Strategy``."""
        ahead = self.spacing - 1 - step % self.spacing
        return ahead < self.settings.views and self.relocates_at(step + 1 + ahead)

    def look(
        self,
        frame: Frame,
        image: DeviceArray,
        target: DeviceArray,
        weights: DeviceArray | None,
    ) -> None:
        """Take note of what each splat shows of a view; see ``Strategy``."""
        self.contributions.add(frame, image, target, weights)

    def after_step(
        self,
        parameters: Parameters,
        frame: Frame,
        gradients: FrameGradients,
        learning_rate: float,
    ) -> Parameters:
        """Relocated every few steps; see ``Strategy``."""
        settings, step = self.settings, parameters.step
        if self.relocates_at(step):
            parameters = relocate_by_residual(
                parameters,
                self.contributions.host(),
                min_opacity=settings.min_opacity,
                min_contribution=self.min_contribution(step),
                added=grown(len(parameters), self.growth(step, len(parameters)), self.run.splats),
                seed=self.run.seed,
            )
            self.contributions.clear(len(parameters))
        return parameters

    def state(self) -> dict[str, NDArray[Any]]:
        """What was seen since the last relocation."""
        return {"contributions": self.contributions.host()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from it; see ``Strategy``."""
        check_names(state, ("contributions",))
        self.contributions.restore(np.asarray(state["contributions"]))


def relocate_by_residual(
    parameters: Parameters,
    contributions: NDArray[np.float32],
    *,
    min_opacity: float,
    min_contribution: float,
    added: int,
    seed: int,
) -> Parameters:
    """Move splats that contribute next to nothing into halves of others, and add new ones.

    Args:
        parameters: the splats; they are not changed.
        contributions: (N, 3), what ``Contributions`` gathered since the last time. A splat that no
            view looked at stays where it is, unless it is transparent.
        min_opacity: opacity up to which a splat is relocated.
        min_contribution: fraction of the median contribution up to which a splat is relocated.
        added: new splats; fewer where there are not as many to be halved.
        seed: random seed, used with the step.

    Returns:
        Parameters in which Adam's moments of all splats that were touched are zero.

    Raises:
        InputError: the splats have densities; ``strategy.xray`` is for them.
    """
    if parameters.density:
        raise InputError("relocate_by_residual: these splats have densities, wanted opacities")
    raw, first, second = parameters.host()
    random = np.random.default_rng((seed, parameters.step, 0xA13))
    unneeded = _unneeded(raw, contributions, min_opacity, min_contribution)
    chance = np.where(unneeded, 0, np.maximum(contributions[:, 0].astype(float), 0))
    free = np.concatenate(
        [np.flatnonzero(unneeded), np.arange(len(parameters), len(parameters) + added)]
    )
    places = free[: np.count_nonzero(chance)]
    # Where new ones are fewer than asked for, none is left without values.
    added = max(0, int(places.max(initial=-1)) + 1 - len(parameters))
    if places.size == 0:
        return parameters
    hosts = random.choice(len(parameters), places.size, replace=False, p=chance / chance.sum())
    take_over(raw, (first, second), hosts=hosts, places=places, added=added)
    _set_apart(raw, hosts, places)
    return parameters.replaced(raw, first, second)


def _unneeded(
    raw: Raw, contributions: NDArray[np.float32], min_opacity: float, min_contribution: float
) -> NDArray[np.bool_]:
    """Which splats are transparent, or make up next to nothing of the views that look at them."""
    transparent = np.asarray(sigmoid(raw["logits"].astype(float)) <= min_opacity)
    pixels, views = contributions[:, 1].astype(float), contributions[:, 2]
    seen = views > 0
    if not seen.any():
        return transparent
    each = np.divide(pixels, views, out=np.zeros_like(pixels), where=seen)
    # Not of the mean: a few splats of a background may make up more pixels than all others.
    return np.asarray(transparent | (seen & (each <= min_contribution * np.median(each[seen]))))


def _set_apart(raw: Raw, hosts: NDArray[np.intp], places: NDArray[np.intp]) -> None:
    """Make two halves of each host and the copy of it at the same index of ``places``."""
    rows = np.arange(hosts.size)
    longest = raw["log_scales"][hosts].argmax(axis=1)
    along = np.zeros((hosts.size, 3))
    along[rows, longest] = _APART * np.exp(raw["log_scales"][hosts, longest].astype(float))
    shift = rotated(raw["quats"][hosts].astype(float), along).astype(np.float32)
    for halves, side in ((hosts, 1), (places, -1)):
        raw["means"][halves] += side * shift
        raw["log_scales"][halves, longest] += np.float32(np.log(_SHRINK))
