"""A pixel loss of your own: the Charbonnier loss, an absolute difference that is smooth at zero.

It is two expressions in OpenCL C, of the difference d and the pixel's weight m, and runs at the
speed of the losses that come with the package.
"""

import numpy as np

import rift_cl as rift
from rift_cl.train import ImageLoss, PixelLoss, TrainSettings, register_loss

register_loss(
    "charbonnier",
    PixelLoss(value="sqrt(d * d + 1e-4f)", gradient="m * d / sqrt(d * d + 1e-4f)"),
)
settings = TrainSettings(loss="charbonnier")  # for a trainer

device = rift.default_device()
random = np.random.default_rng(0)
image, target = (device.array(random.uniform(size=(16, 16, 3))) for _ in range(2))
for kind in ("l1", settings.loss):
    loss, gradient = ImageLoss(kind=kind, ssim_weight=0)(device, image, target)
    norm = np.linalg.norm(device.get(gradient))
    print(f"{kind}: {device.get(loss)[0]:.4f}, gradient {norm:.4f}")
