"""What changes from step to step of a fit: learning rates, and which coefficients there are.

Degrees of harmonics, orders of modes and lobes are added as a fit goes on, with coefficients of
zero, so that no image jumps. Which of them there are follows from the step and the settings, so
that no checkpoint needs to know of it. An environment light is there from the first step on: a
reflection that has once been built as a thing behind the surface is never taken apart again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rift_cl.basis.angular import angular_basis
from rift_cl.basis.angular.environment import start_environment, start_reflectance
from rift_cl.basis.indices import graded
from rift_cl.geometry import Camera
from rift_cl.splat.orders import count_of, order_of
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import MODES, Environment, Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start.lobes import lobe_axes
from rift_cl.train.start.normals import neighbour_normals

# Share of the run after which poses move: what begins as fog would carry all cameras along. Beyond
# the fastest rate the first steps of Adam, as long whatever the gradient, would only throw cameras
# about.
_POSES_BEGIN, _FASTEST_POSES = 0.1, 3e-3
# Learning rates at the very end of the cooldown, as a fraction of those at its beginning.
_LAST_SHARE = 0.05


@dataclass(frozen=True)
class LearningRateSchedule:
    """Learning rates of a run.

    Args:
        settings: of the run.
        extent: size of the scene, in its units.
        views: number of training views.
    """

    settings: TrainSettings
    extent: float
    views: int = 1

    @property
    def cooldown(self) -> int:
        """The step with which the cooldown begins."""
        return round(self.settings.steps * (1 - self.settings.cooldown))

    def learning_rates(self, step: int) -> dict[str, float]:
        """Adam's learning rates at a step, by group; of positions in units of the scene."""
        rates, settings = self.settings.learning_rates, self.settings
        way = min(step / max(self.cooldown, 1), 1.0)
        falling, shapes, fade = rates.means_last**way, rates.shapes_last**way, 1.0
        if step >= self.cooldown:
            into = (step - self.cooldown) / max(settings.steps - self.cooldown, 1)
            fade = _LAST_SHARE**into
        return {
            "means": fade * self.extent * rates.first_means(settings.steps) * falling,
            "quats": fade * rates.quats * shapes,
            "log_scales": fade * rates.log_scales * shapes,
            "logits": fade * rates.logits,
            "sh": fade * rates.sh,
            "shape_modes": fade * rates.shape_modes,
            "color_modes": fade * rates.color_modes,
            "lobes": fade * rates.lobes,
            "environment": fade * rates.environment,
            "reflectance": fade * rates.reflectance,
            "normals": fade * rates.normals,
            "poses": self._pose_share(step) * self._pose_rate,
        }

    @property
    def pose_reach(self) -> float:
        """How far a camera can move, about each axis in radians, along each in extents.

        As far as the settings say, or less in a run of few steps for each view.
        """
        return self._pose_rate * self._pose_shares / self.views

    @cached_property
    def _pose_rate(self) -> float:
        """The largest rate of poses, such that a view's steps add up to the reach.

        A step of Adam is as long as its rate at most, and a view is looked at in one step of as
        many as there are views.
        """
        shares, wanted = self._pose_shares, self.settings.learning_rates.pose_reach
        return min(wanted * self.views / shares, _FASTEST_POSES) if shares else 0.0

    @cached_property
    def _pose_shares(self) -> float:
        return sum(self._pose_share(step) for step in range(self.settings.steps))

    def _pose_share(self, step: int) -> float:
        """The rate of poses at a step, in units of the largest: none at first, then falling."""
        steps = self.settings.steps
        return 1 - step / steps if _POSES_BEGIN * steps <= step < steps else 0.0


class CoefficientSchedule:
    """Adds coefficients to the parameters of a run, and holds some at zero.

    Args:
        settings: of the run.
        cameras: of its training views.
        flat: whether all splats lie in one slice, and modes across it are held.
    """

    def __init__(
        self, settings: TrainSettings, cameras: Sequence[Camera], *, flat: bool = False
    ) -> None:
        self.settings = settings
        self._cameras = cameras
        self._flat = flat

    def rendering(self, parameters: Parameters, rendering: SplatSettings) -> SplatSettings:
        """Rendering settings for the coefficients that are active at this step."""
        angular = self.settings.angular.kind if "lobes" in parameters.raw else "sh"
        activation = self.settings.basis.activation
        if (rendering.activation, rendering.angular) == (activation, angular):
            return rendering
        return replace(rendering, activation=activation, angular=angular)

    def after_step(self, parameters: Parameters) -> None:
        """Add what is due after the steps that were taken; before the first one, too."""
        settings, step = self.settings, parameters.step
        depths = settings.basis.activation != "clamp"
        if parameters.amplitude != depths:
            parameters.amplitude = depths
            parameters.activate()
        if settings.angular.kind == "sh":
            degree = int(np.sqrt(parameters.raw["sh"].shape[1])) - 1
            for joins in settings.degree_joins[degree:]:
                if step >= joins:
                    parameters.add_degree()
        elif "lobes" not in parameters.raw:
            self._add_lobes(parameters)
        if settings.environment.shared and parameters.environment is None:
            self._add_environment(parameters)
        if parameters.sheet is None and self.wants_sheet(step):
            self.renew_normals(parameters)
        self._add_orders(parameters)

    def hold(self, parameters: Parameters) -> None:
        """Update which modes are trained. Call whenever the splats are others."""
        parameters.free = {}
        if not self._flat:
            return
        for name in (name for name in MODES if name in parameters.raw):
            shape = parameters.raw[name].shape
            along = graded(order_of(shape[1] + 1), 3)[1:, 2] == 0
            free = np.broadcast_to(along.reshape(-1, *[1] * (len(shape) - 2)), shape)
            parameters.free[name] = parameters.device.array(free.astype(np.float32))

    def _add_orders(self, parameters: Parameters) -> None:
        basis, joined = self.settings.basis, False
        reached = basis.order_at(parameters.step, self.settings.steps)
        for name, highest in zip(MODES, basis.orders, strict=True):
            wanted = count_of(min(reached, highest)) - 1
            had = parameters.raw[name].shape[1] if name in parameters.raw else 0
            if wanted > had:
                parameters.widen(name, wanted)
                joined = True
        if joined:
            self.hold(parameters)

    def renew_normals(self, parameters: Parameters) -> None:
        """Take normals from the places of neighbours as they are now.

        Nothing is done unless splats share a light, or the prior on normals has begun.
        """
        lit, sheet = "normals" in parameters.raw, self.wants_sheet(parameters.step)
        if not (lit or sheet):
            return
        normals = neighbour_normals(parameters.host()[0]).astype(np.float32)
        if sheet:
            parameters.sheet = parameters.device.array(normals)
        if lit:
            parameters.raw["normals"] = parameters.device.array(normals)
            parameters.redraw()

    def wants_sheet(self, step: int) -> bool:
        """Whether the prior on normals has begun after some steps."""
        return bool(self.settings.surface.at(step / self.settings.steps).normal_consistency)

    def _add_environment(self, parameters: Parameters) -> None:
        device, raw = parameters.device, parameters.host()[0]
        begun = {
            "normals": neighbour_normals(raw).astype(np.float32),
            "reflectance": start_reflectance(len(parameters)).astype(np.float32),
        }
        for name, values in begun.items():
            parameters.raw[name] = device.array(values)
            for moments in (parameters.first, parameters.second):
                moments[name] = device.zeros(values.shape)
        light = start_environment(self.settings.environment.lobes).astype(np.float32)
        parameters.environment = Environment.of(device, light)
        parameters.redraw()

    def _add_lobes(self, parameters: Parameters) -> None:
        chosen, device = self.settings.angular, parameters.device
        if parameters.step < round(chosen.first * self.settings.steps):
            return
        basis = angular_basis(chosen.kind, 1 + chosen.modes)
        geometry = basis.start_geometry(lobe_axes(parameters.host()[0], self._cameras))
        parameters.raw["lobes"] = device.array(geometry.astype(np.float32))
        for moments in (parameters.first, parameters.second):
            moments["lobes"] = device.zeros(geometry.shape)
        parameters.widen("sh", basis.n_linear)
