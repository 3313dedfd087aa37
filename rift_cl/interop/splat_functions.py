"""The stages of splatting as functions that autograd knows: project and shade.

``rift_cl.interop.raster_function`` has the last stage, rasterize.

Between the stages all is a tensor, so that a loss may look at any of it (positions on the screen
for densification, say). Each stage takes all views at once and goes through them in order; the
sums over views have a fixed order too. Gradients are the kernels', not autograd's, and can be
taken once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import torch

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.cl.device import Device
from rift_cl.geometry import Camera
from rift_cl.geometry.camera import CameraModel
from rift_cl.interop.one_derivative import one_derivative
from rift_cl.interop.tensors import to_device, to_host, to_tensor
from rift_cl.splat.features import shade, shade_grad
from rift_cl.splat.projection import SplatGradients, project, project_grad
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats


@dataclass(frozen=True)
class Drawer:
    """What all stages share.

    Args:
        device: the OpenCL device that works.
        settings: how to draw.
        size: (height, width) of every image.
        model: of every camera.
    """

    device: Device
    settings: SplatSettings
    size: tuple[int, int]
    model: CameraModel

    def cameras(self, viewmats: torch.Tensor, Ks: torch.Tensor) -> list[Camera]:
        """The views, checked."""
        pairs = zip(to_host(Ks), to_host(viewmats), strict=True)
        return [Camera(self.size, K, view, self.model) for K, view in pairs]


class Project(torch.autograd.Function):
    """Splats to the screens of V views; see ``kernels/splat/splat_project.cl``.

    Gives means2d (V, N, 2), conics (V, N, 3), weights (V, N), depths (V, N), and, with nothing
    flowing through, extents (V, N, 2), boxes (V, N, 4) int32 and culls (V, N) uint8.
    """

    @staticmethod
    def forward(ctx: Any, how: Drawer, *tensors: Any) -> tuple[torch.Tensor, ...]:
        """Takes means, quats, scales, covars, opacities, viewmats (V, 4, 4) and Ks (V, 3, 3)."""
        device, like, cameras = how.device, tensors[0], how.cameras(*tensors[5:])
        arrays: list[Any] = [None if t is None else to_device(device, t) for t in tensors[:5]]
        splats = Splats(arrays[0], arrays[1], arrays[2], arrays[4], covars=arrays[3])
        views = [project(device, splats, camera, how.settings) for camera in cameras]
        ctx.how, ctx.views, ctx.like = how, views, like
        screens = torch.stack([to_tensor(device, view.screen, like) for view in views])
        rest = [
            torch.stack([to_tensor(device, getattr(view, name), like) for view in views])
            for name in ("depths", "boxes", "culled")
        ]
        parts = (screens[..., :2], screens[..., 2:5], screens[..., 5], rest[0], screens[..., 6:])
        means2d, conics, weights, depths, extents = (part.clone() for part in parts)
        ctx.mark_non_differentiable(extents, *rest[1:])
        ctx.save_for_backward(weights)
        return means2d, conics, weights, depths, extents, *rest[1:]

    @staticmethod
    @one_derivative
    def backward(ctx: Any, *incoming: Any) -> tuple[Any, ...]:
        """Gradients by everything that was projected, summed over the views."""
        means2d, conics, weights, depths = incoming[:4]
        how, like = ctx.how, ctx.like
        first = -weights * ctx.saved_tensors[0]
        twice = conics * conics.new_tensor([2.0, 1.0, 2.0])
        sums = torch.cat([first[..., None], means2d, twice, depths[..., None]], dim=-1)
        total: dict[str, torch.Tensor] = {}
        lenses = []
        signed = replace(how.settings, absgrad=False)
        for projection, own in zip(ctx.views, sums, strict=True):
            found = project_grad(
                replace(projection, settings=signed),
                to_device(how.device, own),
                depth_channel=True,
                first_moments=False,
            )
            for name in ("means", "quats", "scales", "covars", "opacities"):
                _add(total, name, how.device, getattr(found, name), like)
            assert found.camera is not None
            lenses.append(to_tensor(how.device, sum_columns(how.device, found.camera), like))
        names = ("means", "quats", "scales", "covars", "opacities")
        return (None, *(total.get(name) for name in names), *_camera_grads(lenses))


class Shade(torch.autograd.Function):
    """Colours (V, N, 3) of spherical harmonics, seen from V views; see ``splat_shade.cl``."""

    @staticmethod
    def forward(ctx: Any, how: Drawer, *tensors: Any) -> torch.Tensor:
        """Takes means, coefficients (N, K, 3) or (V, N, K, 3), viewmats, Ks and culls."""
        means, sh, viewmats, Ks, culled = tensors
        ctx.how, ctx.cameras = how, how.cameras(viewmats, Ks)
        ctx.each, device = sh.dim() == 4, how.device
        places, colors = to_device(device, means), []
        for view, camera in enumerate(ctx.cameras):
            given = to_device(device, sh[view] if ctx.each else sh)
            seen = shade(device, places, given, camera, to_device(device, culled[view]))
            colors.append(to_tensor(device, seen, means))
        out = torch.stack(colors)
        ctx.save_for_backward(means, sh, out)
        return out

    @staticmethod
    @one_derivative
    def backward(ctx: Any, *incoming: Any) -> tuple[Any, ...]:
        """Gradients by means, coefficients and view matrices."""
        means, sh, out = ctx.saved_tensors
        device, lenses, each = ctx.how.device, [], []
        places, total = to_device(device, means), dict[str, torch.Tensor]()
        for view, camera in enumerate(ctx.cameras):
            given = to_device(device, sh[view] if ctx.each else sh)
            into = _only_features(device, to_device(device, incoming[0][view]))
            features = to_device(device, out[view])
            found = shade_grad(device, places, given, camera, features=features, gradients=into)
            assert found is not None and into.camera is not None
            each.append(to_tensor(device, found, means))
            _add(total, "means", device, into.means, means)
            lenses.append(to_tensor(device, sum_columns(device, into.camera), means))
        by_sh = torch.stack(each) if ctx.each else sum(each[1:], each[0])
        return None, total["means"], by_sh, _camera_grads(lenses)[0], None, None


def _only_features(device: Device, features: Any) -> SplatGradients:
    count = features.shape[0]
    means, camera = device.zeros((count, 3)), device.zeros((device.traits.runs(count), 16))
    no: Any = None
    return SplatGradients(means, no, no, no, no, features, no, no, camera)


def _add(
    total: dict[str, torch.Tensor], name: str, device: Device, array: Any, like: torch.Tensor
) -> None:
    if array is not None:
        tensor = to_tensor(device, array, like)
        total[name] = total[name] + tensor if name in total else tensor


def _camera_grads(lenses: list[torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor]:
    """From (16,) of every view to gradients by viewmats (V, 4, 4) and Ks (V, 3, 3)."""
    rows = torch.stack(lenses)
    views, Ks = rows.new_zeros((len(rows), 4, 4)), rows.new_zeros((len(rows), 3, 3))
    views[:, :3] = rows[:, :12].reshape(-1, 3, 4)
    Ks[:, [0, 1, 0, 1], [0, 1, 2, 2]] = rows[:, 12:]
    return views, Ks
