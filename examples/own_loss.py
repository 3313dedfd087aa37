"""A pixel loss of your own: the Charbonnier loss, an absolute difference that is smooth at zero.

It is two expressions in OpenCL C, of the difference d and the pixel's weight m, and runs at the
speed of the losses that come with the package. The scene is a white ball in four images. Run it
with the number of optimization steps, or give it to ``rift --load``.
"""

import sys

import numpy as np

import rift_cl as rift
from rift_cl.train import (
    ImageViews,
    Parameters,
    PixelLoss,
    Trainer,
    TrainSettings,
    register_loss,
    start_splats,
)

register_loss(
    "charbonnier",
    PixelLoss(value="sqrt(d * d + 1e-4f)", gradient="m * d / sqrt(d * d + 1e-4f)"),
)


def main():
    """Fit with L1 and with this loss."""
    device = rift.default_device()
    cameras = []
    for turn in np.arange(4) * np.pi / 2:  # a ring of cameras around the origin, 4 away
        view = np.eye(4)
        view[0, ::2], view[2, ::2] = (np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))
        view[2, 3] = 4
        cameras.append(rift.Camera((32, 32), [[32, 0, 16], [0, 32, 16], [0, 0, 1]], view))
    disc = np.hypot(*np.mgrid[-15.5:16, -15.5:16]) < 8
    images = [np.repeat(disc[..., None], 3, axis=2)] * 4  # a white ball before black

    points = np.random.default_rng(0).uniform(-1.2, 1.2, (200, 3))
    steps = int(sys.argv[1]) if sys.argv[1:] else 100
    for loss in ("l1", "charbonnier"):
        settings = TrainSettings(steps=steps, loss=loss, ssim_weight=0)
        splats = Parameters.of(device, start_splats(points))
        trainer = Trainer(ImageViews(device, cameras, images), splats, settings)
        losses = [report.values["loss"] for report in trainer.run()]
        print(f"{loss}: loss {losses[0]:.4f} at the first report, {losses[-1]:.4f} at the last")


if __name__ == "__main__":
    main()
