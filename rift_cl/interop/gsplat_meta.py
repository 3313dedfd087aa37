"""The fields of gsplat's ``meta`` that are numbers of things: ids, radii, keys of intersections."""

from __future__ import annotations

from typing import NamedTuple

import torch

from rift_cl.interop.torch import Screens


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
