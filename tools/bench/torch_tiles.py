"""A tile rasterizer of splats in plain torch, on the CPU: the peer that our renderer races.

It is what one would write who has torch and no kernels of his own, and wants it fast; gradients
are autograd's. What makes it fast:

- sigma is a quadratic in the pixel's position, so that the exponents of all splats at all pixels
  of a tile are one matrix product;
- tiles with about as many splats are done together, a number of splats at a time, so that
  tensors are large enough for torch and small enough for the cache;
- pixels come before splats, because torch multiplies cumulatively fast along the last axis alone;
- thresholds are ``threshold`` and not ``where``, which is many times slower.

Conventions are those of ``kernels/include/raster/alpha.h``: the same thresholds, extents and tiles,
so that equal work is compared. Numbers that are not finite are not looked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch.nn.functional import normalize, threshold
from torch.utils.checkpoint import checkpoint

from bench.torch_harmonics import harmonics
from rift_cl.geometry import Camera

TILE = 16
_PIXELS = TILE * TILE
_ALPHA_THRESHOLD, _TRANSMITTANCE_THRESHOLD, _CAP = 1 / 255, 1e-4, 0.99
_EPS2D, _EXTENT, _MARGIN, _NEAR = 0.3, 3.33, 0.15, 0.01
# exp of it is nothing beside 1 in float32; the exponential of less takes ten times as long.
_NOTHING = -80.0
# Splats at a time, and pairs of a splat and a pixel in one tensor.
_CHUNK, _PAIRS = 128, 1 << 18
# Beyond this many pairs autograd keeps nothing of the tiles (some 30 bytes for each pair) and
# draws them again on its way back, which takes half as long again.
_KEPT_PAIRS = 1 << 28


@dataclass(frozen=True)
class _Seen:
    """Splats on the screen: (N, 2) centres and variances, (N, 3) conics, (N,) the others."""

    centers: torch.Tensor
    variances: torch.Tensor
    conics: torch.Tensor
    depths: torch.Tensor
    opacities: torch.Tensor


@dataclass(frozen=True)
class _Lists:
    """The splats of every tile, front to back, one tile after the other."""

    splats: torch.Tensor
    starts: torch.Tensor
    counts: torch.Tensor
    across: int
    down: int


@contextmanager
def flushed_denormals() -> Iterator[None]:
    """Take denormal numbers for zero while this lasts; products of transparencies become such.

    Torch does so in the calling thread alone.
    """
    before = not (torch.tensor([1e-40]) * 1).any()
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(before)


@contextmanager
def on_threads(count: int | None) -> Iterator[None]:
    """Work on so many threads while this lasts; on as many as before if None."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def draw(
    parameters: Mapping[str, torch.Tensor], camera: Camera, background: torch.Tensor
) -> torch.Tensor:
    """Draw splats with harmonics of degree 3 as a pinhole camera sees them: (height, width, 3).

    Args:
        parameters: means, quats, scales, opacities and sh, as ``Splats`` has them.
        camera: the view.
        background: (3,).
    """
    seen = _project(parameters, camera)
    with torch.no_grad():
        lists = _tile_lists(seen, camera)
    away = parameters["means"] - torch.tensor(camera.center, dtype=torch.float32)
    basis = harmonics(normalize(away, dim=1))
    colors = ((basis[:, :, None] * parameters["sh"]).sum(1) + 0.5).clamp(min=0)
    weights = seen.opacities.clamp(min=_ALPHA_THRESHOLD).log()[:, None]
    table = torch.cat([seen.centers, seen.conics, weights, colors], 1)
    # A last row that is nowhere fills up the tiles that have fewer splats than others.
    nobody = torch.tensor([[0, 0, 0, 0, 0, 2 * _NOTHING, 0, 0, 0]])
    tiles = _composite(torch.cat([table, nobody]), lists, background)
    image = tiles.view(lists.down, lists.across, TILE, TILE, 3).transpose(1, 2)
    image = image.reshape(lists.down * TILE, lists.across * TILE, 3)
    return image[: camera.height, : camera.width]


def _project(parameters: Mapping[str, torch.Tensor], camera: Camera) -> _Seen:
    view = torch.tensor(camera.view, dtype=torch.float32)
    rotation, shift = view[:3, :3], view[:3, 3]
    fx, fy, cx, cy = map(float, camera.intrinsics)
    x, y, depths = (parameters["means"] @ rotation.T + shift).unbind(1)
    # Nothing behind the camera is drawn; it must not divide by zero either.
    inverse = 1 / torch.where(depths > _NEAR, depths, 1)
    u, v, zero = fx * x * inverse, fy * y * inverse, torch.zeros_like(x)
    wide, high = camera.width, camera.height
    pu = u.clamp(-_MARGIN * wide - cx, (1 + _MARGIN) * wide - cx)
    pv = v.clamp(-_MARGIN * high - cy, (1 + _MARGIN) * high - cy)
    jacobian = [fx * inverse, zero, -pu * inverse, zero, fy * inverse, -pv * inverse]
    root = _rotation(parameters["quats"]) * parameters["scales"][:, None]
    shape = torch.stack(jacobian, 1).view(-1, 2, 3) @ (rotation @ root)
    covariance = shape @ shape.transpose(1, 2)
    xx, xy = covariance[:, 0, 0] + _EPS2D, covariance[:, 0, 1]
    yy = covariance[:, 1, 1] + _EPS2D
    conics = torch.stack([yy, -xy, xx], 1) / (xx * yy - xy * xy)[:, None]
    centers, variances = torch.stack([u + cx, v + cy], 1), torch.stack([xx, yy], 1)
    return _Seen(centers, variances, conics, depths, parameters["opacities"])


def _rotation(quats: torch.Tensor) -> torch.Tensor:
    w, x, y, z = normalize(quats, dim=1).unbind(1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return torch.stack(rows, 1).view(-1, 3, 3)


def _tile_lists(seen: _Seen, camera: Camera) -> _Lists:
    size = torch.tensor([camera.width, camera.height])
    tiles = -(-size // TILE)
    across, down = tiles.tolist()
    reach = (2 * (seen.opacities / _ALPHA_THRESHOLD).clamp(min=1).log()).sqrt().clamp(max=_EXTENT)
    radii = (reach[:, None] * seen.variances.sqrt()).ceil()
    first, last = seen.centers - radii, seen.centers + radii
    drawn = ((last > 0) & (first < size)).all(1)
    drawn &= (seen.depths > _NEAR) & (seen.opacities >= _ALPHA_THRESHOLD)
    corner = (first / TILE).floor().clamp(min=0).minimum(tiles).long()
    sides = (last / TILE).ceil().clamp(min=0).minimum(tiles).long() - corner
    order = seen.depths.argsort(stable=True)
    counts = (sides.prod(1) * drawn)[order]
    splats = order.repeat_interleave(counts)
    place = torch.arange(len(splats)) - (counts.cumsum(0) - counts).repeat_interleave(counts)
    wide = sides[splats, 0]
    y, x = corner[splats, 1] + place // wide, corner[splats, 0] + place % wide
    tile, by_tile = (y * across + x).sort(stable=True)
    length = tile.bincount(minlength=across * down)
    return _Lists(splats[by_tile], length.cumsum(0) - length, length, across, down)


def _composite(table: torch.Tensor, lists: _Lists, background: torch.Tensor) -> torch.Tensor:
    """The pixels of all tiles, (tiles, pixels, 3)."""
    kept = len(lists.splats) * _PIXELS <= _KEPT_PAIRS
    order = lists.counts.argsort(descending=True, stable=True)
    order = order[: int(lists.counts.count_nonzero())]
    image, drawn, begin = background.expand(len(lists.counts), _PIXELS, 3), [], 0
    while begin < len(order):
        together = min(int(lists.counts[order[begin]]), _CHUNK) * _PIXELS
        tiles = order[begin : begin + max(1, _PAIRS // together)]
        given = (table, lists, tiles, background)
        drawn.append(_tiles(*given) if kept else _tiles_again(*given))
        begin += len(tiles)
    return image.index_copy(0, order, torch.cat(drawn)) if drawn else image


def _tiles_again(*given: object) -> torch.Tensor:
    found: torch.Tensor = checkpoint(_tiles, *given, use_reentrant=False, preserve_rng_state=False)
    return found


def _tiles(
    table: torch.Tensor, lists: _Lists, tiles: torch.Tensor, background: torch.Tensor
) -> torch.Tensor:
    """The pixels of some tiles, of which the first has the most splats."""
    starts, counts = lists.starts[tiles, None], lists.counts[tiles, None]
    corner = torch.stack([tiles % lists.across, tiles // lists.across], 1) * TILE
    middle = corner[:, None] + TILE / 2
    image = background.expand(len(tiles), _PIXELS, 3)
    left, most = torch.ones(len(tiles), _PIXELS, 1), int(counts[0])
    for begin in range(0, most, _CHUNK):
        number = torch.arange(begin, min(begin + _CHUNK, most))
        entry = (starts + number).clamp(max=len(lists.splats) - 1)
        rows = table[torch.where(number < counts, lists.splats[entry], len(table) - 1)]
        color, left = _some_splats(rows, middle, left, background)
        image = image + color
        if float(left.detach().max()) <= _TRANSMITTANCE_THRESHOLD:
            break
    return image


def _some_splats(
    rows: torch.Tensor, middle: torch.Tensor, left: torch.Tensor, background: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """What splats add to the background, and what they leave of it, (tiles, pixels, 1)."""
    exponents = _QUADRATIC @ _coefficients(rows, middle)
    alpha = threshold(exponents, math.log(_ALPHA_THRESHOLD), _NOTHING).exp().clamp(max=_CAP)
    passed = torch.cat([left, 1 - alpha], -1).cumprod(-1)
    shares, left = alpha * passed[..., :-1], passed[..., -1:]
    if float(left.detach().min()) <= _TRANSMITTANCE_THRESHOLD:
        # No share for the splat that finishes a pixel, nor for any behind it.
        shares = shares * threshold(passed[..., 1:].detach(), _TRANSMITTANCE_THRESHOLD, 0).sign()
    # In this order in memory the product takes a quarter of the time.
    colors = (rows[..., 6:] - background).transpose(1, 2).contiguous()
    # A zero would send the gradient of cumprod the slow way; half is as finished.
    return shares @ colors.transpose(1, 2), left.clamp(min=_TRANSMITTANCE_THRESHOLD / 2)


def _coefficients(rows: torch.Tensor, middle: torch.Tensor) -> torch.Tensor:
    """The polynomial ln weight - sigma of the position in the tile, (tiles, 6, splats)."""
    x, y = (rows[..., :2] - middle).unbind(-1)
    a, b, c, weight = rows[..., 2:6].unbind(-1)
    by_x, by_y = a * x + b * y, b * x + c * y
    constant = weight - 0.5 * (by_x * x + by_y * y)
    return torch.stack([constant, by_x, by_y, -0.5 * a, -b, -0.5 * c], 1)


def _quadratic() -> torch.Tensor:
    """1, x, y, x², xy, y² at the pixels of a tile, seen from its middle, (pixels, 6)."""
    along = torch.arange(TILE) - (TILE - 1) / 2
    y, x = (each.reshape(-1) for each in torch.meshgrid(along, along, indexing="ij"))
    return torch.stack([torch.ones(_PIXELS), x, y, x * x, x * y, y * y], 1)


_QUADRATIC = _quadratic()
