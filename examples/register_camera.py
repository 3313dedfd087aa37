"""Find where a picture was taken from: gradients through ``render`` to a camera, with kornia.

kornia brings what torch has not: cameras, rotations as vectors of three numbers, pyramids of
images, and losses such as SSIM. Rendered splats are tensors like any other to it. The camera
begins 9 degrees and 0.3 lengths away from the truth. Run it with the number of steps, 120 if not
given; it wants the extra torch, which brings both: pip install '.[torch]'.
"""

import sys

import torch
from kornia.geometry.camera import PinholeCamera
from kornia.geometry.conversions import axis_angle_to_rotation_matrix
from kornia.geometry.transform import pyrdown
from kornia.losses import charbonnier_loss, ssim_loss

from rift_cl.interop.torch import render

steps = int(sys.argv[1]) if sys.argv[1:] else 120
random = torch.Generator().manual_seed(0)
count, size = 200, (48, 64)
splats = {
    "means": torch.rand(count, 3, generator=random) * 2 - 1,
    "quats": torch.randn(count, 4, generator=random),
    "scales": 0.05 + 0.1 * torch.rand(count, 3, generator=random),
    "opacities": 0.3 + 0.6 * torch.rand(count, generator=random),
    "colors": torch.rand(count, 3, generator=random),
}


def camera(turn, shift):
    """A camera of kornia's that is turned and shifted from one 4 lengths before the splats."""
    pose = torch.eye(4).repeat(1, 1, 1)
    pose[:, :3, :3] = axis_angle_to_rotation_matrix(turn[None])
    pose[:, :3, 3] = torch.tensor([0.0, 0.0, 4.0]) + shift
    lens = torch.eye(4).repeat(1, 1, 1)
    lens[:, 0, 0] = lens[:, 1, 1] = 60.0
    lens[:, 0, 2], lens[:, 1, 2] = size[1] / 2, size[0] / 2
    return PinholeCamera(lens, pose, *(torch.tensor([float(n)]) for n in size))


def drawn(turn, shift):
    """The picture (1, 3, height, width), as kornia has pictures."""
    seen = camera(turn, shift)
    views = {"viewmats": seen.extrinsics, "Ks": seen.intrinsics[:, :3, :3]}
    return render(**splats, **views, size=size)[0].permute(0, 3, 1, 2)


picture = drawn(torch.zeros(3), torch.zeros(3))
turn = torch.tensor([0.09, -0.12, 0.05], requires_grad=True)
shift = torch.tensor([0.2, -0.1, 0.2], requires_grad=True)
adam = torch.optim.Adam([turn, shift], lr=0.02)
for step in range(steps):
    adam.param_groups[0]["lr"] = 0.02 * (1 - step / steps)
    image, truth = drawn(turn, shift), picture
    loss = charbonnier_loss(image, truth, reduction="mean") + ssim_loss(image, truth, 11)
    # A coarser picture knows the way from further off.
    loss = loss + charbonnier_loss(pyrdown(image), pyrdown(truth), reduction="mean")
    adam.zero_grad()
    loss.backward()
    adam.step()
    if step % 20 == 0 or step == steps - 1:
        degrees = turn.norm().rad2deg().item()
        print(f"step {step}: loss {loss.item():.4f}, {degrees:.2f} degrees off,", end=" ")
        print(f"{shift.norm().item():.3f} lengths off")
