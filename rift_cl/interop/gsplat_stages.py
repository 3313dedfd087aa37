"""What gsplat's ``rasterization`` does, stage by stage, for batches of scenes with C cameras each.

Tensors of images are flat in what follows: (B C, N, ...), batch after batch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import prod
from typing import Any, NamedTuple

import torch

from rift_cl.errors import ShapeError
from rift_cl.interop.raster_function import Parts, rasterize_flat
from rift_cl.interop.splat_functions import Drawer
from rift_cl.interop.tensors import check_tensor
from rift_cl.interop.torch import Screens, expect_depth, project, shade, with_depth


@dataclass(frozen=True)
class Scene:
    """The checked tensors of a batch.

    Args:
        how: what all stages are told.
        batch: the batch dimensions.
        tensors: by name, each (B, ...).
    """

    how: Drawer
    batch: tuple[int, ...]
    tensors: dict[str, torch.Tensor]

    @property
    def counts(self) -> tuple[int, int, int]:
        """Scenes, cameras of each, Gaussians of each."""
        return prod(self.batch), self.tensors["viewmats"].shape[1], self.tensors["means"].shape[1]

    def one(self, name: str, number: int) -> torch.Tensor | None:
        """A tensor of one scene of the batch; None if it was not given."""
        return self.tensors[name][number] if name in self.tensors else None

    def views(self, number: int) -> tuple[torch.Tensor, torch.Tensor]:
        """The cameras of one scene of the batch."""
        return self.tensors["viewmats"][number], self.tensors["Ks"][number]


def project_all(scene: Scene) -> Screens:
    """All images' screens."""
    rows, columns = torch.triu_indices(3, 3)
    each = []
    for number, means in enumerate(scene.tensors["means"]):
        covars = scene.one("covars", number)
        six = None if covars is None else covars[:, rows, columns]
        shape = (scene.one("quats", number), scene.one("scales", number))
        opacities = scene.tensors["opacities"][number]
        views = scene.views(number)
        each.append(project(scene.how, means, *shape, opacities, *views, covars=six))
    return Screens(*(torch.cat(parts) for parts in zip(*each, strict=True)))


def color_all(scene: Scene, colors: Any, screens: Screens, sh_degree: int | None) -> torch.Tensor:
    """What every image shows of every Gaussian, (B C, N, D)."""
    B, C, N = scene.counts
    tail = (None,) if sh_degree is None else (None, 3)
    each = isinstance(colors, torch.Tensor) and colors.dim() == len(scene.batch) + 2 + len(tail)
    own = (C, N) if each else (N,)
    like = scene.tensors["means"]
    check_tensor("colors", colors, (*scene.batch, *own, *tail), like)
    colors = colors.reshape(B, *own, *colors.shape[len(scene.batch) + len(own) :])
    if sh_degree is None:
        shown: torch.Tensor = colors if each else colors[:, None].expand(B, C, N, -1)
        return shown.reshape(B * C, N, -1)
    if not 0 <= sh_degree <= 4 or (sh_degree + 1) ** 2 > colors.shape[-2]:
        raise ShapeError(
            f"colors has {colors.shape[-2]} coefficients, sh_degree {sh_degree} wants "
            f"{(sh_degree + 1) ** 2} (degrees are 0 to 4)"
        )
    used, culled = colors[..., : (sh_degree + 1) ** 2, :], screens.culled.reshape(B, C, N)
    # gsplat takes directions from where a camera stands, also where rays are parallel: those of a
    # pinhole at the same place.
    how = replace(scene.how, model="pinhole") if scene.how.model == "ortho" else scene.how
    seen = [
        shade(how, like[number], used[number], *scene.views(number), culled[number])
        for number in range(B)
    ]
    return torch.cat(seen)


def draw_all(
    scene: Scene,
    screens: Screens,
    shown: torch.Tensor | None,
    backgrounds: torch.Tensor | None,
    render_mode: str,
    *,
    packed: bool,
) -> tuple[torch.Tensor, torch.Tensor, dict[str, Any]]:
    """Images (..., C, height, width, X), alphas, and ``meta``."""
    B, C, N = scene.counts
    features, behind = _channels(scene, screens, shown, backgrounds, render_mode)
    ids = packed_ids(screens.culled, C) if packed else None
    meta = _seen(scene, screens, ids)
    names = ("means2d", "conics", "opacities")
    tensors = [meta[name] for name in names] + [_pick(scene, features, ids)]
    kept = (screens.depths.detach(), screens.extents, screens.boxes)
    tensors += [_pick(scene, tensor, ids) for tensor in kept]
    lead = 1 if ids else len(scene.batch) + 2
    flat = [tensor.reshape(-1, *tensor.shape[lead:]) for tensor in tensors]
    parts = Parts(ids.counts if ids else [N] * (B * C), meta["means2d"], listed=True)
    drawn = rasterize_flat(scene.how, parts, *flat[:4], behind, *flat[4:])
    images, alphas, tiles, entries, offsets = drawn
    if render_mode.endswith("ED"):
        images = expect_depth(images, alphas)
    shape, place = (*scene.batch, C), offsets.shape[1:]
    meta |= {
        "tile_width": place[1],
        "tile_height": place[0],
        "tiles_per_gauss": tiles if ids else tiles.reshape(*shape, N),
        "isect_ids": isect_ids(entries, offsets, flat[4]),
        "flatten_ids": entries,
        "isect_offsets": offsets.reshape(*shape, *place),
        "width": scene.how.size[1],
        "height": scene.how.size[0],
        "tile_size": scene.how.settings.tile,
        "n_batches": B,
        "n_cameras": C,
    }
    shape = (*shape, *scene.how.size)
    return images.reshape(*shape, -1), alphas.reshape(*shape, 1), meta


def _channels(
    scene: Scene,
    screens: Screens,
    shown: torch.Tensor | None,
    backgrounds: torch.Tensor | None,
    render_mode: str,
) -> tuple[torch.Tensor, torch.Tensor | None]:
    """Features of all images, and what lies behind them."""
    B, C, _ = scene.counts
    if backgrounds is not None:
        channels = None if shown is None else shown.shape[-1]
        shape = (*scene.batch, C, channels)
        backgrounds = check_tensor("backgrounds", backgrounds, shape, screens.means2d)
        backgrounds = backgrounds.reshape(B * C, -1)
    if render_mode == "RGB":
        assert shown is not None
        return shown, backgrounds
    if shown is None:
        behind = None if backgrounds is None else torch.zeros_like(backgrounds[:, :1])
        return screens.depths[..., None], behind
    return torch.cat([shown, screens.depths[..., None]], dim=-1), with_depth(backgrounds)


def _seen(scene: Scene, screens: Screens, ids: PackedIds | None) -> dict[str, Any]:
    """The fields of ``meta`` that tell of the Gaussians on the screen."""
    fields = {
        "radii": radii_of(screens),
        "means2d": screens.means2d,
        "depths": screens.depths,
        "conics": screens.conics,
        "opacities": screens.weights,
    }
    return {
        "batch_ids": ids.batches if ids else None,
        "camera_ids": ids.cameras if ids else None,
        "gaussian_ids": ids.gaussians if ids else None,
        **{name: _pick(scene, tensor, ids) for name, tensor in fields.items()},
    }


def _pick(scene: Scene, tensor: torch.Tensor, ids: PackedIds | None) -> torch.Tensor:
    """Visible Gaussians of all images in one row, or all of every image."""
    if ids:
        return tensor[ids.images, ids.gaussians]
    return tensor.reshape(*scene.batch, scene.counts[1], *tensor.shape[1:])


class PackedIds(NamedTuple):
    """Which Gaussian of which image each packed row is; all int64 (nnz,).

    Args:
        images: batch times cameras plus camera.
        batches: the batch.
        cameras: the camera within its batch.
        gaussians: the Gaussian.
        counts: rows of every image.
    """

    images: torch.Tensor
    batches: torch.Tensor
    cameras: torch.Tensor
    gaussians: torch.Tensor
    counts: list[int]


def packed_ids(culled: torch.Tensor, cameras: int) -> PackedIds:
    """The rows that are drawn, image after image."""
    seen = culled == 0
    images, gaussians = torch.nonzero(seen, as_tuple=True)
    counts = [int(count) for count in seen.sum(dim=1)]
    return PackedIds(images, images // cameras, images % cameras, gaussians, counts)


def radii_of(screens: Screens) -> torch.Tensor:
    """(images, N, 2) int32: extents rounded up to pixels, 0 for what is not drawn."""
    return torch.ceil(screens.extents).to(torch.int32)


def isect_ids(entries: torch.Tensor, offsets: torch.Tensor, depths: torch.Tensor) -> torch.Tensor:
    """(M,) int64: image, tile and the bits of the depth, from the highest bits to the lowest.

    Args:
        entries: (M,) rows of ``depths``, tile after tile.
        offsets: (images, rows, across) where each tile's entries begin.
        depths: of all rows.
    """
    _, rows, across = offsets.shape
    starts = torch.cat([offsets.flatten(), offsets.new_tensor([len(entries)])]).long()
    number = torch.repeat_interleave(torch.arange(len(starts) - 1), torch.diff(starts).cpu())
    number = number.to(entries.device)
    tiles = rows * across
    bits = depths.contiguous().view(torch.int32)[entries.long()].long() & 0xFFFFFFFF
    tile_bits = tiles.bit_length()
    return (number // tiles) << (tile_bits + 32) | (number % tiles) << 32 | bits
