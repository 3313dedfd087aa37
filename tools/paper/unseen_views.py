"""Photographs that no model has seen, and what models make of them while they learn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.spectra import error_spectrum, ring_edges
from rift_cl import Device
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.io import open_capture
from rift_cl.metrics import psnr
from rift_cl.train import Trainer

# Shares of a model's steps, or of its time, after which it is looked at.
_SHARES = (1 / 4, 1 / 2, 1)
Floats = NDArray[np.float32]


class UnseenViews:
    """Photographs on the ring and off it that no model saw.

    Args:
        device: of the splats.
        captures: on the ring, and off it.
        like: the photographs that are trained on.
        count: of each.
    """

    def __init__(
        self, device: Device, captures: Sequence[Any], like: CapturePictures, count: int
    ) -> None:
        self.groups: dict[str, CapturePictures] = {}
        for name, capture in zip(("ring", "off the ring"), captures, strict=True):
            views = open_capture(capture).views
            few = [views[k] for k in evenly(len(views), count)]
            self.groups[name] = CapturePictures(device, few, like=like)
        self.edges, self.frequency = ring_edges(self.groups["ring"].cameras[0].size)

    def record(self, draw: Callable[[Camera], Floats]) -> dict[str, Any]:
        """Mean PSNR and relative error by frequency of both groups."""
        found = {}
        for name, group in self.groups.items():
            behind = group.behind
            images = [group.shown(draw(camera)) for camera in group.cameras]
            truths = [group.shown(group.over(k, behind)) for k in range(len(images))]
            scores = [psnr(image, truth) for image, truth in zip(images, truths, strict=True)]
            less = [[image - behind for image in part] for part in (images, truths)]
            error, _ = error_spectrum(*less, self.edges)
            found[name] = {"psnr": float(np.mean(scores)), "error": error.tolist()}
        return found


def splat_moments(
    trainer: Trainer, views: UnseenViews, draw: Callable[[Camera], Floats] | None = None
) -> Iterator[dict[str, Any]]:
    """The moments of a fit of splats, which may be drawn in another way than by its renderer."""
    device, steps, seconds = trainer.device, trainer.settings.steps, 0.0
    behind = device.array(views.groups["ring"].behind)

    def plain(camera: Camera) -> Floats:
        frame = trainer.renderer.forward(trainer.parameters.drawn, camera, background=behind)
        return np.asarray(device.get(frame.image))

    for share in _SHARES:
        began = time.process_time()
        while trainer.parameters.step < max(1, round(share * steps)):
            trainer.step()
        device.finish()
        seconds += time.process_time() - began
        yield {"step": trainer.parameters.step, "cpu_s": seconds, **views.record(draw or plain)}


def field_moments(fit: Any, budget: float, views: UnseenViews) -> Iterator[dict[str, Any]]:
    """The moments of a field, after shares of the time that it has."""
    steps, seconds = 0, 0.0
    for share in _SHARES:
        while seconds < share * budget:
            began = time.process_time()
            fit.step()
            seconds += time.process_time() - began
            steps += 1
        yield {"step": steps, "cpu_s": seconds, **views.record(fit.field.picture)}
