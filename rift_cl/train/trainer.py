"""Fitting splats to posed pictures: one picture a step, everything on the device.

A step draws a view, takes the gradient of the loss, and moves the splats by Adam. Splats that have
faded are renewed now and then (``rift_cl.train.renewal``), and take random walks; in the last part
of the run, the finish, noise and penalties are off and all rates fade, so that the picture settles.

What a run does depends on its settings, its pictures and the device alone: the order of the views,
the noise and the renewal all come from the seed and the number of the step.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.geometry import Camera
from rift_cl.progress import Report
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.image_loss import ImageLoss
from rift_cl.train.parameters import Parameters
from rift_cl.train.renewal import renew
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start import scene_extent

# Steps between two reports; the loss comes to the host for each.
_REPORT_EVERY = 25
# Rates at the very end of the finish, as a share of those at its beginning.
_LAST_SHARE = 0.05


class Pictures(Protocol):
    """What a trainer looks at: cameras, and what each of them saw."""

    cameras: Sequence[Camera]

    def begin(self, step: int) -> None:
        """Called before each step."""

    def target(self, number: int) -> Any:
        """(height, width, 3) device array in display light, over the background."""

    def background(self, number: int) -> Any:
        """(3,) device array: what is behind the splats in that picture."""


@dataclass(frozen=True)
class Schedule:
    """What changes from step to step.

    Args:
        settings: of the run.
        extent: of the scene.
    """

    settings: TrainSettings
    extent: float

    @property
    def finish(self) -> int:
        """The step with which the finish begins."""
        return round(self.settings.steps * (1 - self.settings.finish))

    def rates(self, step: int) -> dict[str, float]:
        """Adam's rates at a step, by group."""
        rates, settings = self.settings.rates, self.settings
        way = min(step / max(self.finish, 1), 1.0)
        fade = 1.0
        if step >= self.finish:
            into = (step - self.finish) / max(settings.steps - self.finish, 1)
            fade = _LAST_SHARE**into
        return {
            "means": fade * self.extent * rates.means * rates.means_last**way,
            "quats": fade * rates.quats,
            "log_scales": fade * rates.log_scales,
            "logits": fade * rates.logits,
            "sh": fade * rates.sh,
        }

    def renews(self, step: int) -> bool:
        """Whether splats are renewed after a step."""
        renewal = self.settings.renewal
        return step >= renewal.first and step % renewal.every == 0 and step < self.settings.steps

    def grows(self, step: int) -> bool:
        """Whether splats are added when they are renewed after a step."""
        return step < self.settings.steps * self.settings.renewal.last


class Trainer:
    """A fit in progress.

    Args:
        pictures: what is fitted.
        parameters: the splats to begin with.
        settings: of the fit.
        drawing: of the rasterizer.
    """

    def __init__(
        self,
        pictures: Pictures,
        parameters: Parameters,
        settings: TrainSettings,
        drawing: SplatSettings | None = None,
    ) -> None:
        self.pictures = pictures
        self.parameters = parameters
        self.settings = settings
        self.device: Device = parameters.device
        self.renderer = Renderer(drawing or SplatSettings(), device=self.device)
        self.schedule = Schedule(settings, scene_extent(pictures.cameras))
        self.loss = ImageLoss(ssim_weight=settings.ssim_weight)

    def run(self) -> Iterator[Report]:
        """Fit until all steps are done, from where the parameters stand; a report now and then."""
        total = self.settings.steps
        while self.parameters.step < total:
            value = self.step()
            done = self.parameters.step
            if done % _REPORT_EVERY == 0 or done == total:
                loss = float(self.device.get(value)[0])
                values = {"loss": loss, "splats": float(len(self.parameters))}
                yield Report(done, total, "steps", values)

    def step(self) -> Any:
        """One picture; the loss as a (1,) device array."""
        settings, parameters = self.settings, self.parameters
        number = self.view_at(parameters.step)
        self.pictures.begin(parameters.step)
        frame = self.renderer.forward(
            parameters.drawn,
            self.pictures.cameras[number],
            background=self.pictures.background(number),
        )
        value, by_image = self.loss(self.device, frame.image, self.pictures.target(number))
        gradients = self.renderer.backward(frame, by_image, with_background=False)
        finishing = parameters.step >= self.schedule.finish
        rates, renewal = self.schedule.rates(parameters.step), settings.renewal
        parameters.update(
            gradients,
            rates,
            sh_rest=settings.rates.sh_rest,
            opacity_penalty=0.0 if finishing else renewal.opacity_penalty,
            scale_penalty=0.0 if finishing else renewal.scale_penalty,
        )
        self._renew(rates["means"], finishing=finishing)
        return value

    def _renew(self, rate: float, *, finishing: bool) -> None:
        """What happens between two steps: the next degree, new places, the random walk."""
        settings, step = self.settings, self.parameters.step
        degree = int(np.sqrt(self.parameters.raw["sh"].shape[1])) - 1
        if step % settings.sh_every == 0 and degree < settings.sh_degree:
            self.parameters.add_degree()
        if self.schedule.renews(step):
            grow = self.schedule.grows(step)
            self.parameters = renew(
                self.parameters,
                settings.renewal,
                most=settings.splats,
                seed=settings.seed,
                grow=grow,
            )
        if not finishing:
            self.parameters.shake(settings.renewal.noise * rate, settings.seed)

    def view_at(self, step: int) -> int:
        """The picture that is looked at in a step: all of them once, in a new order every time."""
        count = len(self.pictures.cameras)
        order = np.random.default_rng((self.settings.seed, step // count, 0x0DE)).permutation(count)
        return int(order[step % count])
