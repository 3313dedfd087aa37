"""Splats sampled on a voxel grid, on a device.

A pixel is a mean over a little square and a voxel one over a little cube. The rasterizer stands for
the square by a dilation that keeps every splat's mass; the same dilation along all three axes makes
slices whose projections are what the rasterizer draws.

``kernels/splat/hermite_dilate.cl`` brings splats into steps of the grid,
``kernels/splat/hermite_voxelise.cl`` sums them, ``rift_cl.reference.voxels`` is the twin of both.
The grid is cut into bricks, and each layer of bricks has the tile lists of an image, in the order
of the splats' numbers, so that the same call gives the same bits, in whatever memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import format_bytes
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array
from rift_cl.errors import InputError, ResourceLimitError, ShapeError
from rift_cl.geometry import Grid
from rift_cl.geometry.numbers import real_numbers
from rift_cl.splat.bands import FrameMemory, plan_bands
from rift_cl.splat.orders import count_of
from rift_cl.splat.splats import Splats
from rift_cl.splat.tile_lists import Tiles, tile_lists

# Voxels of a brick along x, y, z; items that a GPU has for one (BLOCK_X of the kernel is 4).
_BRICK = np.array([16, 8, 8])
_GPU_ITEMS = 16 * 8 * 8 // 4
# Numbers of a splat's row before its coefficients.
_SHAPE_NUMBERS = 12
# Of boxes, so that no voxel is left out whose distance was rounded.
_MARGIN = 1e-4
# What float32 counts exactly.
_MOST_SAMPLES = 1 << 24
# Bytes of a splat in a layer's lists (its row, box and depth), and of what does not grow.
_LISTED, _SMALL = 24, 4096
_LARGEST = float(np.finfo(np.float32).max)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def voxelise(
    device: Device,
    splats: Splats,
    grid: Grid,
    *,
    dilation: float | Sequence[float] = 0.0,
) -> DeviceArray:
    """Sum splats at the samples of a grid.

    Splats that the rasterizer would not draw (not finite, without a direction or a size) are left
    out. Colours play no part.

    Args:
        device: where to work.
        splats: N splats on this device; opacities are densities at the peak, of any size, and of
            any sign (the rasterizer leaves negative ones out).
        grid: (nz, ny, nx), in the unit of the splats' means.
        dilation: variance that every splat gains along the axes (x, y, z), one for all or one
            for each, in the square of that unit, while its mass stays.

    Returns:
        (nz, ny, nx) device array.

    Raises:
        ShapeError: the grid is an image, or an array a strided view.
        InputError: the dilation is negative or not finite, or the grid too large to count.
        ResourceLimitError: volume and splats, or the lists of one row of bricks, do not fit the
            memory budget.
        DeviceError: an array lives on another device.
    """
    _check(device, splats, grid)
    blur = _variances(dilation, grid)
    memory = _fixed_bytes(splats, grid)
    _check_room(splats, grid, memory, device.budget)
    volume = device.zeros(grid.shape)
    work = _Work.of(device, splats, grid, blur)
    for layer in range(-(-grid.shape[0] // int(_BRICK[2]))):
        work.fill(device, volume, layer, memory)
    return volume


@dataclass(frozen=True, eq=False)
class _LayerMemory(FrameMemory):
    """What a layer's lists take, beside what all layers share."""

    shared: int = 0

    @property
    def fixed(self) -> int:
        return self.shared + _LISTED * self.splats + _SMALL


@dataclass(frozen=True, eq=False)
class _Work:
    """Splats brought into steps of a grid.

    Args:
        grid: the volume's.
        table: (N, 12 + K) device array, see ``hermite_dilate.cl``.
        low: (N, 3) int32, the first brick that a splat touches, (x, y, z).
        high: (N, 3) int32, one past the last; not above ``low`` where it touches none.
        order: of the polynomials.
    """

    grid: Grid
    table: DeviceArray
    low: Ints
    high: Ints
    order: int

    @classmethod
    def of(cls, device: Device, splats: Splats, grid: Grid, blur: Floats) -> _Work:
        count, order = len(splats), splats.shape_order
        places, anchors = _places(device, splats, grid)
        table = device.empty((count, _SHAPE_NUMBERS + count_of(order)))
        sides = device.empty((count, 3))
        device.launch(
            "hermite_dilate",
            (count,),
            quats=splats.quats,
            scales=splats.scales,
            covars=splats.covars,
            opacities=splats.opacities,
            shape_modes=splats.shape_modes,
            places=device.array(anchors),
            table=table,
            extents=sides,
            **{f"per_{axis}": 1 / step for axis, step in zip("xyz", _steps(grid), strict=True)},
            **{f"blur_{axis}": root for axis, root in zip("xyz", np.sqrt(blur), strict=True)},
            count=count,
            COVARIANCES=splats.covars is not None,
            ORDER=order,
        )
        return cls(grid, table, *_boxes(places, device.get(sides), grid), order)

    def fill(self, device: Device, volume: DeviceArray, layer: int, shared: int) -> None:
        """Sum the splats that touch a layer of bricks there."""
        touch = (self.low[:, 2] <= layer) & (layer < self.high[:, 2])
        chosen = np.flatnonzero(touch & (self.low < self.high)[:, :2].all(axis=1))
        if chosen.size == 0:
            return
        boxes = np.concatenate([self.low[chosen, :2], self.high[chosen, :2]], axis=1)
        across, rows, _ = -(-_counts(self.grid) // _BRICK)
        tiles = Tiles(int(across), int(rows))
        memory = _LayerMemory(chosen.size, 1, 0, 0, shared=shared)
        listing = device.array(chosen, np.int32), device.array(boxes), device.zeros(chosen.size)
        room = device.budget, device.traits.allocation
        for band in plan_bands(boxes, tiles, memory, *room):
            self._fill_band(device, volume, layer, band, listing)

    def _fill_band(
        self,
        device: Device,
        volume: DeviceArray,
        layer: int,
        band: Tiles,
        listing: tuple[DeviceArray, DeviceArray, DeviceArray],
    ) -> None:
        chosen, boxes, depths = listing
        lists = tile_lists(device, boxes, depths, band, sort=False)
        items = 1 if device.traits.is_cpu else _GPU_ITEMS
        device.launch(
            "hermite_voxelise",
            (band.count * items,),
            volume=volume,
            table=self.table,
            chosen=chosen,
            entries=lists.entries,
            starts=lists.starts,
            **dict(zip(("nz", "ny", "nx"), self.grid.shape, strict=True)),
            bricks_x=band.across,
            first_row=band.first_row,
            layer=layer,
            bricks=band.count,
            **{f"BRICK_{axis}": int(n) for axis, n in zip("XYZ", _BRICK, strict=True)},
            ORDER=self.order,
        )


def _counts(grid: Grid) -> NDArray[np.int64]:
    """Samples along x, y, z."""
    return np.array(grid.shape[::-1])


def _steps(grid: Grid) -> Floats:
    """Distances between samples along x, y, z."""
    return np.array(grid.spacing[::-1])


def _places(device: Device, splats: Splats, grid: Grid) -> tuple[Floats, NDArray[np.float32]]:
    """Means in steps of the grid from its first sample on; and a whole number and the rest of each.

    The whole number is near the grid, so that what the rest loses is small beside its splat.
    """
    first = [grid.coordinates(axis)[0] for axis in (2, 1, 0)]
    places = (device.get(splats.means).astype(float) - first) / _steps(grid)
    places[~np.isfinite(places).all(axis=1)] = np.nan
    whole = np.clip(np.rint(np.nan_to_num(places)), -1, _counts(grid))
    anchors = np.concatenate([whole, np.nan_to_num(places) - whole], axis=1)
    return places, np.clip(anchors, -_LARGEST, _LARGEST).astype(np.float32)


def _boxes(places: Floats, sides: NDArray[np.float32], grid: Grid) -> tuple[Ints, Ints]:
    """The bricks [low, high) that splats touch; the same where there are none."""
    reach = sides.astype(float) * (1 + _MARGIN) + _MARGIN
    there = (sides >= 0).all(axis=1) & np.isfinite(places).all(axis=1)
    most = _counts(grid)
    low = np.clip(np.ceil(places - reach), 0, most)
    high = np.clip(np.floor(places + reach) + 1, 0, most)
    there &= (low < high).all(axis=1)
    low, high = np.where(there[:, None], (low // _BRICK, -(-high // _BRICK)), 0)
    return low.astype(np.int32), high.astype(np.int32)


def _variances(dilation: float | Sequence[float], grid: Grid) -> Floats:
    """The dilation along x, y, z in squares of the grid's steps."""
    numbers = real_numbers(dilation)
    if numbers is None or numbers.shape not in ((), (1,), (3,)):
        raise InputError(
            f"voxelise: dilation is {dilation!r}, wanted one variance, or one for each of (x, y, z)"
        )
    with np.errstate(over="ignore"):
        blur: Floats = np.broadcast_to(numbers, (3,)) / _steps(grid) ** 2
    if not ((numbers >= 0).all() and (blur <= _LARGEST).all()):
        raise InputError(
            f"voxelise: dilation is {dilation!r}, wanted variances >= 0, finite in float32 when "
            f"divided by the square of the spacing {grid.spacing}"
        )
    return blur


def _check(device: Device, splats: Splats, grid: Grid) -> None:
    if not isinstance(grid, Grid) or len(grid.shape) != 3:
        shape = getattr(grid, "shape", grid)
        raise ShapeError(f"voxelise: grid is {shape!r}, wanted a Grid of (nz, ny, nx)")
    if max(grid.shape) > _MOST_SAMPLES:
        raise InputError(
            f"voxelise: grid is {grid.shape}, at most {_MOST_SAMPLES} samples along an axis: "
            "cut it into parts"
        )
    for name, array in vars(splats).items():
        if array is not None:
            as_device_array(device, array, array.shape, name=name)


def _fixed_bytes(splats: Splats, grid: Grid) -> int:
    """What is taken whatever the number of bands: parameters, rows, boxes, volume."""
    floats = sum(int(array.size) for array in vars(splats).values() if array is not None)
    row = _SHAPE_NUMBERS + count_of(splats.shape_order)
    return 4 * (floats + len(splats) * (row + 9) + prod(grid.shape))


def _check_room(splats: Splats, grid: Grid, need: int, budget: int) -> None:
    if need > budget:
        raise ResourceLimitError(
            f"{len(splats)} splats and a volume of {grid.shape} voxels need {format_bytes(need)}, "
            f"the memory budget is {format_bytes(budget)}: raise the budget (RIFT_MEMORY or "
            "--memory), use a device with more memory, or take a smaller grid, as some slices"
        )
