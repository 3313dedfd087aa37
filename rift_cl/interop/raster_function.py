"""Compositing as a function that autograd knows: the stage after project and shade."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch

from rift_cl.cl.device import Device
from rift_cl.interop.one_derivative import apply, one_derivative
from rift_cl.interop.splat_functions import Drawer
from rift_cl.interop.tensors import to_device, to_tensor
from rift_cl.splat.bands import FrameMemory
from rift_cl.splat.raster import MOMENTS, ScreenSplats
from rift_cl.splat.raster_pass import RasterPass, draw, draw_grad, listed


class Parts(NamedTuple):
    """How the splats of several views lie one after the other.

    Args:
        counts: splats of each view.
        means2d: their positions as the caller has them, in any shape: where ``absgrad`` is left.
        listed: whether the tile lists are wanted on the host.
    """

    counts: list[int]
    means2d: torch.Tensor
    listed: bool = False


class Rasterize(torch.autograd.Function):
    """Screens to images (V, height, width, D) and alphas (V, height, width, 1).

    Also gives, with nothing flowing through, each view's tile lists if they are wanted: the tiles
    of every splat (total,), the splats of all entries (M,), and where each tile's begin
    (V, rows, across), all int32 and counted over all views; otherwise three empty tensors.
    """

    @staticmethod
    def forward(ctx: Any, how: Drawer, parts: Parts, *tensors: Any) -> tuple[Any, ...]:
        """Takes the splats of all views one after the other.

        Tensors are means2d (total, 2), conics, weights, features (total, D), backgrounds (V, D)
        or None, then depths, extents and boxes, through which nothing flows.
        """
        means2d, conics, weights, features, backgrounds, depths, extents, boxes = tensors
        screen = torch.cat([means2d, conics, weights[:, None], extents], dim=1)
        ctx.how, ctx.parts, ctx.passes = how, parts, []
        for view, rows in enumerate(_runs(parts.counts)):
            behind = None if backgrounds is None else to_device(how.device, backgrounds[view])
            arrays = [to_device(how.device, t[rows]) for t in (screen, depths, boxes, features)]
            ctx.passes.append(_draw(how, arrays, behind))
        ctx.save_for_backward(means2d, conics, weights)
        images = [to_tensor(how.device, d.raster.image, means2d) for d in ctx.passes]
        thin = [to_tensor(how.device, d.raster.transmittance, means2d) for d in ctx.passes]
        nothing = [means2d.new_empty(0, dtype=torch.int32) for _ in range(3)]
        lists = _lists(how.device, ctx.passes, means2d) if parts.listed else nothing
        ctx.mark_non_differentiable(*lists)
        return (torch.stack(images), 1 - torch.stack(thin)[..., None], *lists)

    @staticmethod
    @one_derivative
    def backward(ctx: Any, *incoming: Any) -> tuple[Any, ...]:
        """Gradients by all that was drawn; positions gain ``absgrad`` where that is asked for."""
        device, (means2d, conics, weights) = ctx.how.device, ctx.saved_tensors
        sums, behind = [], []
        for view, one in enumerate(ctx.passes):
            by_image = to_device(device, incoming[0][view])
            by_thin = to_device(device, -incoming[1][view, ..., 0])
            sums.append(to_tensor(device, draw_grad(device, one, by_image, by_thin), means2d))
            if one.background is not None:
                thin = to_tensor(device, one.raster.transmittance, means2d)
                behind.append((thin[..., None] * incoming[0][view]).sum((0, 1)))
        s = torch.cat(sums)
        if ctx.how.settings.absgrad:
            ctx.parts.means2d.absgrad = s[:, -2:].reshape(ctx.parts.means2d.shape)
            s = s[:, :-2]
        a, b, c = conics.unbind(1)
        by_mean = torch.stack([a * s[:, 1] + b * s[:, 2], b * s[:, 1] + c * s[:, 2]], dim=1)
        by_conic = s[:, 3:6] * s.new_tensor([0.5, 1.0, 0.5])
        by_weight = torch.where(weights > 0, -s[:, 0] / weights, torch.zeros_like(weights))
        by_background = torch.stack(behind) if behind else None
        found = (by_mean, by_conic, by_weight, s[:, MOMENTS:], by_background)
        return (None, None, *found, None, None, None)


def _draw(how: Drawer, arrays: list[Any], background: Any) -> RasterPass:
    screen, depths, boxes, features = arrays
    pixels = how.size[0] * how.size[1]
    absgrad = how.settings.absgrad
    memory = FrameMemory(len(depths), 0, pixels, features.shape[1], absgrad=absgrad)
    return draw(
        how.device,
        ScreenSplats(screen, features),
        *(boxes, depths, how.size),
        settings=how.settings,
        memory=memory,
        background=background,
    )


def _lists(device: Device, passes: list[RasterPass], like: torch.Tensor) -> list[torch.Tensor]:
    tiles, splats, starts, before, entries = [], [], [], 0, 0
    for one in passes:
        of_each, owners, begins = listed(device, one)
        tiles.append(of_each)
        splats.append(owners + before)
        starts.append((begins + entries).reshape(one.tiles.rows, one.tiles.across))
        before, entries = before + len(of_each), entries + len(owners)
    arrays = (np.concatenate(tiles), np.concatenate(splats), np.stack(starts))
    return [torch.from_numpy(a.astype(np.int32)).to(like.device) for a in arrays]


def _runs(counts: list[int]) -> list[slice]:
    ends = np.cumsum([0, *counts]).tolist()
    return [slice(*pair) for pair in pairwise(ends)]


def rasterize_flat(
    how: Drawer, parts: Parts, *tensors: torch.Tensor | None
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """What ``Rasterize`` gives, with types."""
    images, alphas, tiles, entries, starts = apply(Rasterize, how, parts, *tensors)
    return images, alphas, tiles, entries, starts
