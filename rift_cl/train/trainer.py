"""Fitting splats to posed images: one image a step, everything on the device.

A step renders a training view, takes the gradient of the loss, and moves the splats by Adam, and
the view's pose and exposure if they are refined too. Between steps the set of splats changes
(``rift_cl.train.strategy``); in the last part of the run, the cooldown, nothing walks at random and
all learning rates fall, so that the image settles.

What a run does depends on its settings, its views and the device alone: the order of the views
and all that is random come from the seed and the number of the step. So ``state``, taken between
any two steps, is all that a run needs to go on to the same bits.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Protocol, final

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.errors import CheckpointError, InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.progress import Report
from rift_cl.splat.renderer import Frame, Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.band_limit import BandLimiter
from rift_cl.train.loss.coverage_weight import weight_of
from rift_cl.train.loss.homogenised_loss import HomogenisedLoss
from rift_cl.train.loss.own_loss import check_own_loss
from rift_cl.train.parameters import Environment, Parameters
from rift_cl.train.per_view.exposures import Exposures
from rift_cl.train.per_view.octaves import Octaves
from rift_cl.train.per_view.poses import Poses
from rift_cl.train.schedules import CoefficientSchedule, LearningRateSchedule
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start.points import scene_extent, scene_size
from rift_cl.train.state_schema import check_state
from rift_cl.train.strategy import Strategy, TrainingRun
from rift_cl.train.strategy.unkept import UnkeptAttributes
from rift_cl.train.surface_settings import SurfacePenalties

# Steps between two reports; the loss comes to the host for each.
REPORT_EVERY = 25
# Steps after which the limit of splats' bands, and normals of reflecting splats, are set anew.
_BAND_EVERY = _NORMALS_EVERY = 100
# What a step costs beside its splats, and what it does for a pixel of each splat that there may be;
# what harmonics of degree 1 add to a splat, and what each further degree adds, all in the cost of
# as many splats of one color as there may be. Fitted to the times of steps on PoCL
# (``tools/time_left.py``) with 1.2 pixels to a splat. How the first two share that is a guess,
# which matters where images are halved: at a tenth of such a run what was told was 13 to 41 % off.
_STEP, _PIXEL, _FIRST_DEGREE, _NEXT_DEGREE = 0.5, 0.1, 0.5, 0.25
# Splats begin large, so each covers more pixels: what the first step costs more, as a share, and
# how much of that is left one step later. Fitted to the same times.
_LARGE, _SHRINK = 0.75, math.exp(-1 / 60)


Group = Mapping[str, NDArray[Any]]


class TrainingViews(Protocol):
    """What a trainer fits: cameras, and the image that each of them took.

    ``ImageViews`` is one for arrays in memory.
    """

    cameras: Sequence[Camera]

    def begin(self, step: int) -> None:
        """Called before each step, with the number of steps that were taken."""

    def target(self, number: int) -> Any:
        """The image of a view, (height, width, C) device array of float32, over the background."""

    def weights(self, number: int) -> Any:
        """Weights of the pixels in the loss, (height, width) device array; None where all are 1."""

    def background(self, number: int) -> Any:
        """What is behind the splats in that image, (C,) device array."""


class Trainer:
    """A fit in progress.

    A subclass may give the fit more to do around each step, in ``_before_step``
    and ``_after_step``.

    Args:
        pictures: the training views.
        parameters: the splats to begin with; the trainer changes them in place.
        settings: of the fit.
        rendering: how splats are rendered; the activation is that of the settings.
        flat: whether all splats lie in one slice.
        extent: the length that positions' rates are measured in; how far the cameras spread when
            not given.

    Raises:
        InputError: the strategy is not for such splats, or ``settings.solve`` not for this trainer.
    """

    solves = False  # Whether steps heed ``settings.solve``.

    def __init__(
        self,
        pictures: TrainingViews,
        parameters: Parameters,
        settings: TrainSettings,
        rendering: SplatSettings | None = None,
        *,
        flat: bool = False,
        extent: float | None = None,
    ) -> None:
        self.pictures = pictures
        self.parameters = parameters
        settings = settings.decided(len(pictures.cameras))
        octaves = settings.octaves.decided(pictures.cameras)
        settings = replace(settings, octaves=octaves)
        self.settings = settings
        self.flat = flat
        settings.solve.check_heed(self.solves)
        self.device: Device = parameters.device
        check_own_loss(self.device, settings.loss)
        views = len(pictures.cameras)
        extent = scene_extent(pictures.cameras) if extent is None else extent
        self.schedule = LearningRateSchedule(settings, extent, views)
        self.size = scene_size(pictures.cameras)
        self._mean_pixels = sum(math.prod(camera.size) for camera in pictures.cameras) / views
        run = TrainingRun(
            settings.steps,
            settings.splats,
            settings.seed,
            extent,
            self.schedule.cooldown,
            size=self.size,
        )
        self.strategy = settings.strategy.begin(parameters, run)
        if not isinstance(self.strategy, Strategy) or not hasattr(self.strategy, "run"):
            kind = type(settings.strategy).__name__
            raise InputError(
                f"{kind}.begin: gave {self.strategy!r}, wanted a Strategy, whose own __init__ "
                "calls super().__init__(run)"
            )
        self._unkept: UnkeptAttributes | None = UnkeptAttributes(self.strategy)
        rendering = self.strategy.render_settings(rendering or SplatSettings())
        if all(camera.model != "ortho" for camera in pictures.cameras):
            rendering = rendering.for_scene(self.size)
        self.renderer = Renderer(rendering, device=self.device)
        self.coefficient_schedule = CoefficientSchedule(settings, pictures.cameras, flat=flat)
        self._add_coefficients()
        self.poses = Poses(pictures.cameras, extent) if settings.refine_poses else None
        self.exposures = Exposures(self.device, views) if settings.refine_exposures else None
        self.octaves = None
        if octaves.count:
            self.octaves = Octaves(self.device, pictures, octaves, settings.steps)
        self.loss = HomogenisedLoss(
            self.device,
            settings.homogenisation,
            ssim_weight=settings.ssim_weight,
            kind=settings.loss,
            noise=settings.noise or 0.0,
            coverage=weight_of(settings.homogenisation, pictures.cameras, self.device),
        )
        self._band = None
        if settings.band_limit:
            by_coverage = settings.band_limit == "coverage"
            noise = (settings.noise or 0.0) if by_coverage else None
            self._band = BandLimiter(self.device, pictures, noise=noise)
        if self._band is not None and parameters.band is None:
            self._limit_band()

    def run(self, stopped: Callable[[], bool] = lambda: False) -> Iterator[Report]:
        """Train from the parameters' current step to the last.

        Args:
            stopped: asked after each step whether to stop there.

        Yields:
            A report every 25 steps, and one after the last step: the loss, the number of splats.
        """
        total, worked = self.settings.steps, 0.0
        while self.parameters.step < total:
            level = 0 if self.octaves is None else self.octaves.level
            worked += self._work(self.parameters.step, len(self.parameters), level=level)
            value, stop = self.step(), stopped()
            done = self.parameters.step
            if done % REPORT_EVERY == 0 or done == total or stop:
                loss = float(self.device.get(value)[0])
                self._check_finite(loss)
                values = {"loss": loss, "splats": float(len(self.parameters))}
                if done == total:
                    self._warn_of_lost()
                yield Report(done, total, "steps", values, (worked, worked + self._work_left()))
            if stop:
                return

    def _check_finite(self, loss: float) -> None:
        if not math.isfinite(loss):
            raise NonFiniteError(
                f"the loss is {loss} after step {self.parameters.step}: the fit has diverged, "
                "usually by learning rates that are too high or by a loss of one's own that is not "
                "finite; checkpoints from before are kept"
            )

    def _warn_of_lost(self) -> None:
        """Say how many splats no image shows and no loss tells of."""
        lost = np.zeros(len(self.parameters), bool)
        for array in self.parameters.host()[0].values():
            lost |= ~np.isfinite(array).reshape(len(lost), -1).all(axis=1)
        if lost.any():
            warnings.warn(
                f"{lost.sum()} of {len(lost)} splats hold NaN or infinity after the last step and "
                "are not drawn, usually by learning rates that are too high or by a loss or "
                "strategy of one's own",
                stacklevel=3,
            )

    @final
    def step(self) -> DeviceArray:
        """One optimization step, on one training view; the loss as a (1,) device array."""
        self._before_step()
        value = self._step()
        self._after_step()
        return value

    def _before_step(self) -> None:
        """What a subclass does before a step: nothing here."""

    def _after_step(self) -> None:
        """What a subclass does after a step: nothing here."""

    def _step(self) -> DeviceArray:
        settings, parameters = self.settings, self.parameters
        step = parameters.step
        number, rates = self.view_at(step), self.schedule.learning_rates(step)
        self.pictures.begin(step)
        camera = self.camera(number)
        frame = self.renderer.forward(
            parameters.drawn,
            camera if self.octaves is None else self.octaves.camera(camera),
            background=self.pictures.background(number),
        )
        value, by_image = self._compared(frame, number)
        shares = settings.learning_rates
        sh_rest = shares.lobes_rest if "lobes" in parameters.raw else shares.sh_rest
        kept = self.strategy.wants_sh_gradient
        gradients = self.renderer.backward(
            frame,
            by_image,
            with_camera=self.poses is not None,
            with_background=False,
            sh_step=None if kept else parameters.sh_step(rates, sh_rest=sh_rest),
            retain=self.strategy.wants_frame,
        )
        if self.poses is not None and gradients.camera is not None:
            by_view = self.device.get(gradients.camera)[:12].reshape(3, 4).astype(float)
            self.poses.update(number, by_view, rates["poses"])
        penalties = self.strategy.penalties(step)
        parameters.update(
            gradients,
            rates,
            sh_rest=sh_rest,
            opacity_penalty=penalties.opacity,
            scale_penalty=penalties.scale,
            ridge=settings.basis.ridge,
            surface=self._surface_penalties(step),
        )
        self._add_coefficients()
        self.parameters = self.strategy.after_step(parameters, frame, gradients, rates["means"])
        if not isinstance(self.parameters, Parameters):
            raise InputError(
                f"{type(self.strategy).__name__}.after_step: gave {self.parameters!r}, wanted the "
                "Parameters to go on with"
            )
        self._check_step(step + 1)
        self._check_count(len(parameters))
        relocated = self.parameters is not parameters
        if relocated:
            self.coefficient_schedule.hold(self.parameters)
        if relocated or self.parameters.step % _NORMALS_EVERY == 0:
            self.coefficient_schedule.renew_normals(self.parameters)
        if self._band is not None and (relocated or self.parameters.step % _BAND_EVERY == 0):
            self._limit_band()
        return value

    def _check_step(self, wanted: int) -> None:
        """Check that the strategy left the count of steps alone, by which a run ends."""
        if self.parameters.step != wanted:
            raise InputError(
                f"step {wanted}: {type(self.strategy).__name__}.after_step gave Parameters of step "
                f"{self.parameters.step}: make others by replaced or selected of those that came, "
                "or by Parameters.of(..., step=parameters.step)"
            )

    def _check_count(self, before: int) -> None:
        """Check what the strategy made of the number of splats."""
        now, most, step = len(self.parameters), self.settings.splats, self.parameters.step
        if not now:
            raise InputError(f"step {step}: the strategy has removed every splat")
        if now > max(before, most):
            raise InputError(
                f"step {step}: {type(self.strategy).__name__} made {now} splats of {before}, "
                f"wanted at most {most} (TrainSettings.splats)"
            )

    def _surface_penalties(self, step: int) -> SurfacePenalties:
        if step >= self.schedule.cooldown:
            return SurfacePenalties()
        found = self.settings.surface.at(step / self.settings.steps)
        return found._replace(flatness=found.flatness / self.size)

    def _work(self, step: int, splats: int, steps: int = 1, level: int = 0) -> float:
        """Cost of steps, in units of one step with all splats of one color each.

        Images are halved ``level`` times.
        """
        degree = sum(step >= joins for joins in self.settings.degree_joins)
        harmonics = _FIRST_DEGREE + _NEXT_DEGREE * (degree - 1) if degree else 0.0
        pixels = self._mean_pixels / self.settings.splats * 0.25**level
        one = _STEP + _PIXEL * pixels + splats / self.settings.splats * (1 + harmonics)
        large = _LARGE * _SHRINK**step * (1 - _SHRINK**steps) / (1 - _SHRINK)
        return one * (steps + large)

    def _work_left(self) -> float:
        """The cost of all steps to come, as if no image were halved any more."""
        step, left = self.parameters.step, 0.0
        joins = self.settings.degree_joins
        for steps, count in self.strategy.forecast(step, len(self.parameters)):
            end = step + steps
            for until in [*(at for at in joins if step < at < end), end]:
                left += self._work(step, count, until - step)
                step = until
        return left

    def alike(self, parameters: Parameters) -> Trainer:
        """A fit of the same views by the same settings that begins with other splats."""
        rendering = self.renderer.settings
        given = self.pictures, parameters, self.settings, rendering
        return type(self)(*given, flat=self.flat, extent=self.schedule.extent)

    def camera(self, number: int) -> Camera:
        """The camera of a view, with its pose as refined so far."""
        return self.pictures.cameras[number] if self.poses is None else self.poses.camera(number)

    def state(self) -> dict[str, NDArray[Any]]:
        """All that changes from step to step, as host arrays by name."""
        parameters = self.parameters
        raw, first, second = parameters.host()
        groups: dict[str, Group] = {
            "raw": raw,
            "first": first,
            "second": second,
            "strategy": self._strategy_state(),
            "loss": self.loss.state(),
        }
        if parameters.environment is not None:
            groups["environment"] = parameters.environment.state(self.device)
        if parameters.sheet is not None:
            groups["sheet"] = {"normals": self.device.get(parameters.sheet)}
        if parameters.band is not None:
            groups["band"] = {"lengths": self.device.get(parameters.band)}
        for name, part in self._parts().items():
            groups[name] = part.state()
        return {"step": np.array(parameters.step), **_flattened(groups)}

    def _strategy_state(self) -> Group:
        """The strategy's state, and a warning, once, where it seems to be forgotten."""
        state = self.strategy.state()
        changed = self._unkept.changed() if self._unkept and not state else []
        if changed:
            kind, self._unkept = type(self.strategy).__name__, None
            warnings.warn(
                f"{kind}: {' and '.join(changed)} changed since the fit began, and {kind}.state() "
                "keeps nothing: a resumed fit begins with other values and may give other splats. "
                "Keep them by state() and restore(), or compute them from parameters.step",
                stacklevel=3,
            )
        return state

    def _parts(self) -> dict[str, Any]:
        """What a run has besides splats, strategy and loss, by its name in a state."""
        parts = {"poses": self.poses, "exposures": self.exposures, "octaves": self.octaves}
        return {name: part for name, part in parts.items() if part is not None}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a state of a run with the same settings and views.

        Raises:
            CheckpointError: it is of another run, or no state at all; nothing was changed then if
                an array is not what it has to be.
        """
        check_state(state, views=len(self.pictures.cameras))
        groups = _grouped(state)
        try:
            self.parameters = Parameters.of(
                self.device,
                groups["raw"],
                first=groups["first"],
                second=groups["second"],
                step=int(state["step"]),
                density=self.parameters.density,
                amplitude=self.parameters.amplitude,
                band=groups.get("band", {}).get("lengths"),
                environment=self._restored_environment(groups),
                sheet=self._restored_sheet(groups, int(state["step"])),
            )
            self.coefficient_schedule.hold(self.parameters)
            self._update_renderer()
            self.strategy.restore(groups.get("strategy", {}))
            self.loss.restore(groups["loss"])
            if (self.octaves is None) == ("octaves" in groups):
                raise CheckpointError("the checkpoint is of another run: one has octaves")
            for name, part in self._parts().items():
                part.restore(groups[name])
        except (KeyError, ShapeError) as error:
            raise CheckpointError(f"the checkpoint is of another run ({error})") from error

    def _restored_sheet(self, groups: Mapping[str, Group], step: int) -> NDArray[np.float32] | None:
        wanted = self.coefficient_schedule.wants_sheet(step)
        if wanted != ("sheet" in groups):
            raise CheckpointError("the checkpoint is of another run: one has a prior on normals")
        return groups["sheet"]["normals"] if wanted else None

    def _restored_environment(self, groups: Mapping[str, Group]) -> Environment | None:
        if (self.parameters.environment is None) == ("environment" in groups):
            raise CheckpointError("the checkpoint is of another run: one has a shared light")
        if self.parameters.environment is None:
            return None
        return Environment.restored(self.device, groups["environment"])

    def _compared(self, frame: Frame, number: int) -> tuple[DeviceArray, DeviceArray]:
        """The loss of a rendered image and its gradient."""
        pictures, exposures, image = self.pictures, self.exposures, frame.image
        target, weights = pictures.target(number), pictures.weights(number)
        if self.octaves is not None:
            target, weights = self.octaves.sized(target, weights)
        exposed = image if exposures is None else exposures.applied(image, number)
        shrink = 1 if self.octaves is None else 2**self.octaves.level
        value, by_exposed = self.loss(exposed, target, weights=weights, view=number, shrink=shrink)
        if (self.parameters.step + 1) % REPORT_EVERY == 0:
            self.loss.watch(exposed, target, weights=weights)
        if self.strategy.looks_at(self.parameters.step):
            self.strategy.look(frame, exposed, target, weights)
        if self.octaves is not None:
            self.octaves.after_step(self.parameters.step + 1, exposed, target, weights)
        if exposures is None:
            return value, by_exposed
        by_image = exposures.gradient(by_exposed, number)
        exposures.fit(image, target, weights, number)
        return value, by_image

    def _add_coefficients(self) -> None:
        """Add coefficients scheduled for this step; rebuild the renderer if needed."""
        self.coefficient_schedule.after_step(self.parameters)
        self._update_renderer()

    def _update_renderer(self) -> None:
        """Rebuild the renderer where splats have become others than it renders."""
        rendering = self.coefficient_schedule.rendering(self.parameters, self.renderer.settings)
        if rendering is not self.renderer.settings:
            self.renderer = Renderer(rendering, device=self.device)

    def _limit_band(self) -> None:
        if self._band is not None:
            self._band.limit(self.parameters, near=self.renderer.settings.near_plane)

    def view_at(self, step: int) -> int:
        """The view of a step: all of them once, then all again in another random order."""
        count = len(self.pictures.cameras)
        return _order(self.settings.seed, step // count, count)[step % count]


@lru_cache(maxsize=1)
def _order(seed: int, turn: int, count: int) -> list[int]:
    """The order of all views in one turn."""
    order: list[int] = np.random.default_rng((seed, turn, 0x0DE)).permutation(count).tolist()
    return order


def _flattened(groups: Mapping[str, Group]) -> dict[str, NDArray[Any]]:
    """One level of named arrays, which is what a checkpoint holds: "group.name"."""
    return {f"{group}.{key}": array for group in groups for key, array in groups[group].items()}


def _grouped(state: Group) -> dict[str, dict[str, NDArray[Any]]]:
    """Undoes ``_flattened``."""
    groups: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in state.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = array
    return groups
