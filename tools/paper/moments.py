"""A fit looked at while it is trained: which frequencies of its pictures are right, and when."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from paper.spectra import error_spectrum, ring_edges
from rift_cl import Device
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_photos.start import first_splats
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.progress_bar import show_progress
from rift_cl.io import open_capture
from rift_cl.metrics import psnr
from rift_cl.train import Trainer
from rift_cl.train.loss.homogenisation import noise_of

# Shares of the steps after which the pictures are looked at.
SHARES = (1 / 8, 1 / 4, 1 / 2, 1)
_PICTURES, _NOISE_VIEWS = 12, 8


def watched(settings: FitPhotosSettings, test: Any, device: Device) -> dict[str, Any]:
    """Train as ``Fit`` would, and take the spectrum of the error now and then.

    Args:
        settings: of the fit; nothing is written to its folder.
        test: the capture whose pictures are looked at.
        device: where to work.

    Returns:
        JSON: the frequencies in cycles per pixel, and for each moment the step, the mean PSNR,
        and by frequency the error's and the pictures' power over the truth's.
    """
    trainer, pictures = start(settings, device)
    views = open_capture(test).views
    few = evenly(len(views), _PICTURES)
    unseen = CapturePictures(device, [views[k] for k in few], like=pictures)
    edges, frequency = ring_edges(unseen.cameras[0].size)
    moments = []
    for share in SHARES:
        step = max(1, round(share * settings.training.steps))
        show_progress(_until(trainer, step), quiet=False)
        moments.append({"step": step, **_spectra(trainer, unseen, edges)})
    return {"frequency": frequency, "pictures": len(few), "moments": moments}


def start(settings: FitPhotosSettings, device: Device) -> tuple[Trainer, CapturePictures]:
    """A fit before its first step, as ``Fit`` would begin it, and its photographs."""
    capture = open_capture(settings.capture)
    pictures = CapturePictures(device, capture.views, seed=settings.training.seed)
    first = first_splats(
        device,
        capture,
        pictures,
        count=settings.training.splats,
        guessed=settings.first_count,
        seed=settings.training.seed,
    )
    training = settings.training.decided(len(capture.views))
    if training.needs_noise:
        few = np.linspace(0, len(capture.views) - 1, _NOISE_VIEWS).round().astype(int)
        noise = noise_of([pictures.image(k)[..., :3] for k in np.unique(few).tolist()])
        training = dataclasses.replace(training, noise=noise)
    return Trainer(pictures, first, training, settings.rendering), pictures


def _until(trainer: Trainer, step: int) -> Iterator[Any]:
    """Train up to a step."""
    return trainer.run(lambda: trainer.parameters.step >= step)


def _spectra(trainer: Trainer, unseen: CapturePictures, edges: Any) -> dict[str, Any]:
    behind, device = unseen.behind, trainer.device
    images, truths = [], []
    for number, camera in enumerate(unseen.cameras):
        frame = trainer.renderer.forward(
            trainer.parameters.drawn, camera, background=device.array(behind)
        )
        images.append(unseen.shown(device.get(frame.image)))
        truths.append(unseen.over(number, behind))
    scores = [psnr(image, truth) for image, truth in zip(images, truths, strict=True)]
    error, power = error_spectrum(
        [image - behind for image in images], [truth - behind for truth in truths], edges
    )
    return {"psnr": float(np.mean(scores)), "error": error, "power": power}
