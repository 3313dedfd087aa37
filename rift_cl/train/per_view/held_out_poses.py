"""Poses of photographs that were held out, each fitted to its own photograph.

Refined poses of the training views carry the splats along with them: whoever scores a held-out
photograph from where it was said to be scores the error of its pose, and the motion that all
training views have in common. So a held-out camera is first moved by that motion, and then by some
steps of Adam along the gradient of the loss by its pose; the splats stay as they are. The pose of
the least loss is kept. NeRF-- (Wang et al. 2021) and BARF (Lin et al. 2021) score so.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from rift_cl.cl.array import DeviceArray
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.train.loss.image_loss import ImageLoss
from rift_cl.train.per_view.exposures import Exposures, fitted_exposure
from rift_cl.train.per_view.poses import Poses

if TYPE_CHECKING:
    from rift_cl.train.trainer import Trainer, TrainingViews

# Steps for a view. Each costs what one of training does, so that these are few dozens.
_STEPS = 40


def placed_cameras(trainer: Trainer, pictures: TrainingViews) -> Iterator[Camera]:
    """The cameras of views that were held out, where their photographs say that they are.

    Args:
        trainer: a fit whose poses are refined, with all its steps behind it.
        pictures: the views that were held out, with cameras as they were given.

    Raises:
        InputError: the poses of this fit are not refined.
    """
    if trainer.poses is None:
        raise InputError("placed_cameras: the poses of this fit are not refined")
    motion = trainer.poses.common_motion(trainer.size)
    poses = Poses([motion.camera(camera) for camera in pictures.cameras], trainer.poses.extent)
    for number in range(len(pictures.cameras)):
        yield _placed(trainer, pictures, poses, number)


def _placed(trainer: Trainer, pictures: TrainingViews, poses: Poses, number: int) -> Camera:
    best, least = poses.camera(number), float("inf")
    reach = trainer.settings.learning_rates.pose_reach
    target, weights = pictures.target(number), pictures.weights(number)
    background = pictures.background(number)
    for step in range(_STEPS + 1):
        camera = poses.camera(number)
        frame = trainer.renderer.forward(trainer.parameters.drawn, camera, background=background)
        loss, by_image = _compared(trainer, frame.image, target, weights)
        if loss < least:
            best, least = camera, loss
        if step == _STEPS:
            break
        gradients = trainer.renderer.backward(
            frame, by_image, with_camera=True, with_background=False, retain=False
        )
        if gradients.camera is None:
            return best
        by_view = trainer.device.get(gradients.camera)[:12].reshape(3, 4).astype(float)
        # Falls to zero, and adds up to the reach.
        poses.update(number, by_view, 2 * reach / (_STEPS + 1) * (1 - step / _STEPS))
    return best


def _compared(
    trainer: Trainer, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None
) -> tuple[float, DeviceArray]:
    """The loss of an image and its gradient, with the exposure that serves it best if fitted."""
    device, settings = trainer.device, trainer.settings
    loss = ImageLoss(settings.ssim_weight, settings.loss)
    if trainer.exposures is None:
        value, by_image = loss(device, image, target, weights=weights)
        return float(device.get(value)[0]), by_image
    exposures = Exposures(device, 1)
    counted = None if weights is None else device.get(weights) > 0
    exposures.values[0] = fitted_exposure(device.get(image), device.get(target), counted)
    value, by_exposed = loss(device, exposures.applied(image, 0), target, weights=weights)
    return float(device.get(value)[0]), exposures.gradient(by_exposed, 0)
