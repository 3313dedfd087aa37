"""Where the views of a parallel scan lie in the image's spectrum: rays, and what crosses a tile.

By the Fourier slice theorem sample l of a view's transform is the image's spectrum at
``l / (length pitch)`` cycles per unit of length in the view's direction. Counted in cells of the
padded image's spectrum that is ``l * step``. Rays are reflected to point to the right, since a real
image's spectrum is its own conjugate there, and stand in the order of their angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Parallel
from rift_cl.operators.fourier.gridding import fast_lengths

Floats = NDArray[np.float64]

# Bins on either side of the image's shadow that are read as well, besides the hat's own width.
_BESIDE = 8
_STEP = 16
# A view that begins further from the detector than this, in bins, misses it as well from here.
_FAR = float(1 << 29)
_FINEST = 64
# Reciprocals of steps that are next to nothing.
_LARGEST_INVERSE = 1e9
_ANGLE_ROUNDING = 1e-9
# Frequencies up to which rays are kept if no lobes are asked for, in cycles per sample of the
# image along either axis, of which 1/2 can be told apart. Below the detector's own Nyquist
# frequency the data say something about what lies beyond and folds back into a sampled image:
# _MEASURED. Above it there are only repetitions, which the footprint spares as it does in the
# direct projector: _CONTINUED, and _FINER where bins are finer than samples. Filtered
# backprojection of Shepp and Logan's phantom, 256 x 256, 384 views, is then never more than 0.05 dB
# behind the direct one's, with bins of 1/4 to 5/4 of a sample; with 0.71 for the first it is 1.4
# behind at 1/4, with 0.55 for the last 0.23 at 3/4, and with 0.5 for the second 0.1 at 1.
_MEASURED, _CONTINUED, _FINER = 0.85, 0.55, 0.71
# A pitch below this share of a spacing is a finer one, and no rounding.
_SAME = 0.999
# What stands for these in the place of a number of lobes.
IMAGE = "image"


@dataclass(frozen=True)
class Rays:
    """The rays of a scan in the order of their angle.

    Args:
        order: which view each is, (n,) int32.
        starts: bin in the first row of its transform, (n,) int32.
        turns: by how much sample l is turned, in 2^-32 turns for each l, (n,) uint32.
        shadows: of a pixel's edges along x and along y in bins, over 2 length, (2, n) float64.
        signs: -1 for rays that were reflected, (n,) float64.
        directions: cells along (x, y) for each cycle per ``length`` bins, times the edges, (n, 2).
        window: bins that the image's shadow can reach.
        length: samples of a transform.
        ends: samples of each ray that are kept, (n,) int32.
    """

    order: NDArray[np.int32]
    starts: NDArray[np.int32]
    turns: NDArray[np.uint32]
    shadows: NDArray[np.float64]
    signs: NDArray[np.float64]
    directions: NDArray[np.float64]
    window: int
    length: int
    ends: NDArray[np.int32]


def too_fine(grid: Grid, scan: Parallel) -> bool:
    """Whether bins are so much finer than samples that rays are no way to go."""
    return scan.pitch * _FINEST < min(grid.spacing[-2:])


def rays(grid: Grid, scan: Parallel, lobes: int | str = IMAGE) -> Rays:
    """The rays of a scan of one slice.

    Args:
        grid: the slice.
        scan: how it is looked at.
        lobes: of the spectrum of a bin that are kept, see ``FastProjector``.

    Raises:
        InputError: bins are too fine for this method.
    """
    (dy, dx), pitch = grid.spacing, scan.pitch
    if too_fine(grid, scan):
        raise InputError(
            f"pitch is {pitch:g}, samples are {grid.spacing} apart: FastProjector wants bins of at "
            f"least 1/{_FINEST} of a sample; use Projector"
        )
    y, x = (grid.coordinates(axis) for axis in (0, 1))
    middle_y, middle_x = float(y[len(y) // 2]), float(x[len(x) // 2])
    radius = math.hypot(len(x) // 2 * dx, len(y) // 2 * dy) / pitch
    cosine, sine = np.cos(scan.angles), np.sin(scan.angles)
    shadows = np.abs(np.stack([dx * cosine, dy * sine])) / pitch
    reach = radius + max(1.0, float(shadows.max())) + _BESIDE
    length = fast_lengths(math.ceil(2 * reach) + 1, _STEP)[0]
    seen = scan.center + (middle_x * cosine + middle_y * sine) / pitch
    starts = np.clip(np.ceil(seen - reach), -_FAR, _FAR)
    turns = np.clip(seen - starts, 0, 2 * reach) / length
    directions = np.stack([dx * cosine, dy * sine], axis=1) / (length * pitch)
    signs = np.where((cosine < 0) | ((cosine == 0) & (sine < 0)), -1.0, 1.0)
    directions *= signs[:, None]
    order = np.argsort(np.arctan2(directions[:, 1], directions[:, 0]), kind="stable")
    return Rays(
        order=order.astype(np.int32),
        starts=starts[order].astype(np.int32),
        turns=(np.rint(turns[order] * 2.0**32).astype(np.int64) & 0xFFFFFFFF).astype(np.uint32),
        shadows=shadows[:, order] / (2 * length),
        signs=signs[order],
        directions=directions[order],
        window=math.floor(2 * reach) + 1,
        length=length,
        ends=_ends(directions[order], length, lobes, finer=pitch < _SAME * max(dx, dy)),
    )


def _ends(directions: Floats, length: int, lobes: int | str, *, finer: bool) -> NDArray[np.int32]:
    """How many samples of each ray are kept."""
    if lobes != IMAGE:
        kept = int(lobes) * length if lobes else length // 2
        return np.full(len(directions), kept, np.int32)
    # Samples from one cycle per sample of the image to the next, on the axis where they are fewer.
    cycle = 1 / np.abs(directions).max(axis=1)
    measured = np.minimum(_MEASURED * cycle, length / 2)
    continued = np.minimum((_FINER if finer else _CONTINUED) * cycle, length)
    ends: NDArray[np.int32] = np.ceil(np.maximum(measured, continued)).astype(np.int32)
    return ends


def fixed_steps(found: Rays, edges: tuple[int, int]) -> NDArray[np.int64]:
    """Cells along (x, y) from sample to sample, in 32.32 fixed point, (n, 2)."""
    return np.rint(found.directions * (edges[1], edges[0]) * 2.0**32).astype(np.int64)


def inverse_steps(steps: NDArray[np.int64]) -> NDArray[np.float32]:
    """Samples from cell to cell along (x, y), (n, 2), large where there is next to no step."""
    with np.errstate(divide="ignore"):
        inverse = np.clip(2.0**32 / steps, -_LARGEST_INVERSE, _LARGEST_INVERSE)
    return inverse.astype(np.float32)


def tile_visits(
    steps: NDArray[np.int64],
    ends: int | NDArray[np.int32],
    edges: tuple[int, int],
    width: int,
    tile: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Which rays may cross which tile of the stored half of the grid.

    Args:
        steps: of the rays, in the order of their angle, (n, 2).
        ends: samples of a ray on either side of zero, zero included: of all, or of each.
        edges: of the grid along (y, x).
        width: of the kernel, in cells.
        tile: edge of a tile, in cells.

    Returns:
        Visits (x, y, first ray, rays), (v, 4), tile by tile, the tile's first cell being given
        where the ray meets it; and where each tile's visits begin, (tiles + 1,).
    """
    rows, edge = edges
    last = np.broadcast_to(np.asarray(ends) - 1, len(steps))[:, None]
    reach = np.abs(steps * last).max(axis=0) / 2.0**32 + width
    across, down = -(-(edge // 2 + 1) // tile), -(-rows // tile)
    numbers = np.arange(across * down)
    found = []
    for turn_x in range(-math.ceil(reach[0] / edge) - 1, math.ceil(reach[0] / edge) + 1):
        for turn_y in range(-math.ceil(reach[1] / rows) - 1, math.ceil(reach[1] / rows) + 1):
            x = numbers % across * tile + turn_x * edge
            y = numbers // across * tile + turn_y * rows
            near = (x <= reach[0]) & (x + tile >= -reach[0])
            near &= (y <= reach[1]) & (y + tile >= -reach[1])
            found.append(np.stack([numbers, x, y], axis=1)[near])
    places = np.concatenate(found)
    places = places[np.argsort(places[:, 0], kind="stable")]
    first, count = _crossing(steps, places[:, 1:], width, tile)
    visits = np.concatenate([places[:, 1:], first[:, None], count[:, None]], axis=1)
    starts = np.searchsorted(places[:, 0], np.arange(across * down + 1))
    return visits.astype(np.int32), starts.astype(np.int32)


def _crossing(
    steps: NDArray[np.int64], corners: NDArray[np.int64], width: int, tile: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The rays, of all lines through zero, whose angles a tile and its surroundings span."""
    angles = np.arctan2(steps[:, 1].astype(float), steps[:, 0].astype(float))
    half = tile / 2 + width / 2
    middle = corners + (tile - 1) / 2
    turned = np.arctan2(middle[:, 1], middle[:, 0])
    offsets = []
    for along, up in ((-half, -half), (-half, half), (half, -half), (half, half)):
        corner = np.arctan2(middle[:, 1] + up, middle[:, 0] + along)
        offsets.append((corner - turned + np.pi) % (2 * np.pi) - np.pi)
    low, high = np.min(offsets, axis=0), np.max(offsets, axis=0)
    everything = (np.abs(middle) <= half).all(axis=1)
    begin = turned + low
    begin -= np.pi * np.floor((begin + np.pi / 2) / np.pi)
    doubled = np.concatenate([angles, angles + np.pi, angles + 2 * np.pi])
    first = np.searchsorted(doubled, begin - _ANGLE_ROUNDING)
    last = np.searchsorted(doubled, begin + (high - low) + _ANGLE_ROUNDING, side="right")
    count = np.where(everything, len(angles), np.minimum(last - first, len(angles)))
    return np.where(everything, 0, first % len(angles)), count
