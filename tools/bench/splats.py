"""Splats: the scenes that are drawn, the operations on them, and what each kernel has to do.

The scene is a cube of small Gaussians with spherical harmonics of degree 3 (seed 0), as in the
comparison of rasterizers that the design quotes. Compositing is counted in lanes: pixels of the
blocks (4 x 8, those of the CPU's kernels) that a splat's ellipse touches before the block is
finished. Lane use is the share of them in which the splat counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Floats
from bench.costs import Cost
from bench.operations import Task
from bench.splat_scenes import random_splats
from bench.training import TRAINING_COSTS, training_operations
from rift_cl.basis.angular.environment import start_environment, start_reflectance
from rift_cl.geometry import Camera
from rift_cl.splat import Frame, FrameGradients, Renderer, Splats
from rift_cl.splat.raster import MOMENTS
from rift_cl.splat.tile_lists import TileLists, seen_slots

# Operations per lane, forward and backward: the count that the design's prototype used.
_FORWARD, _BACKWARD = 32, 62
# Lobes of a light that splats share.
_LOBES = 128
# Pixels of a block.
_ROWS, _COLUMNS = 8, 4


@dataclass(frozen=True)
class SplatCase:
    """A scene and an image size; its frame is drawn once to count the work.

    Args:
        count: number of splats.
        size: pixels along each side.
        device: where to draw.
    """

    count: int
    size: int
    device: rift.Device

    @property
    def name(self) -> str:
        """How tables call it."""
        return f"{self.count} splats, {self.size}²"

    @cached_property
    def parameters(self) -> dict[str, Floats]:
        """The cube of Gaussians: host arrays by the names that ``Splats`` gives them."""
        return random_splats(self.count)

    @cached_property
    def splats(self) -> Splats:
        """The same on the device."""
        return Splats.upload(self.device, **self.parameters)

    @property
    def background(self) -> Floats:
        """What is behind the cube, (3,)."""
        return np.float32([0.1, 0.2, 0.3])

    @cached_property
    def grad_image(self) -> Floats:
        """A loss's gradient by the image, white noise."""
        random = np.random.default_rng(1)
        return random.normal(size=(self.size, self.size, 3)).astype(np.float32)

    @cached_property
    def camera(self) -> Camera:
        """Observations at the cube from four half-edges away."""
        view = np.eye(4)
        view[2, 3] = 4
        focal, center = 1.2 * self.size, self.size / 2
        K = [[focal, 0, center], [0, focal, center], [0, 0, 1]]
        return Camera((self.size, self.size), K, view)

    @cached_property
    def frame(self) -> Frame:
        """The drawn scene."""
        return self._forward()

    @cached_property
    def gradients(self) -> FrameGradients:
        """The gradients of ``frame`` for ``grad_image``."""
        grad = self.device.array(self.grad_image)
        return Renderer(device=self.device).backward(self.frame, grad)

    @cached_property
    def lit_splats(self) -> Splats:
        """The same splats with normals of all directions under a light that they share."""
        random = np.random.default_rng(3)
        return Splats.upload(
            self.device,
            **self.parameters,
            normals=random.normal(size=(self.count, 3)),
            reflectance=start_reflectance(self.count),
            environment=start_environment(_LOBES),
        )

    @cached_property
    def lit_frame(self) -> Frame:
        """The scene under that light."""
        return Renderer(device=self.device).forward(self.lit_splats, self.camera)

    @cached_property
    def depth_frame(self) -> Frame:
        """The scene with its expected depth."""
        return Renderer(device=self.device).forward(self.splats, self.camera, depth="expected")

    def _forward(self) -> Frame:
        background = self.device.array(self.background)
        return Renderer(device=self.device).forward(self.splats, self.camera, background=background)

    def _seen(self) -> TileLists:
        """The scene drawn, and what a gradient of large scenes on CPUs does to its lists then."""
        frame = self._forward()
        edge = frame.raster_pass.settings.edge
        return seen_slots(self.device, frame.lists, frame.raster.last, frame.camera.size, edge)

    @cached_property
    def tasks(self) -> list[Task]:
        """What is done with the scene, on device arrays."""
        grad = self.device.array(self.grad_image)
        noise = np.random.default_rng(2).normal(size=(self.size, self.size, 4))
        deep = self.device.array(noise)
        renderer = Renderer(device=self.device)
        runs = {
            "draw": self._forward,
            "gradient": lambda: renderer.backward(self.frame, grad, with_camera=True),
            "draw with light": lambda: renderer.forward(self.lit_splats, self.camera),
            "gradient with light": lambda: renderer.backward(
                self.lit_frame, grad, with_camera=True
            ),
            "depth": lambda: renderer.forward(self.splats, self.camera, depth="expected"),
            "depth gradient": lambda: renderer.backward(self.depth_frame, deep, with_camera=True),
            "draw and find seen entries": self._seen,
            **training_operations(self),
        }
        return [Task(name, self, run, SPLAT_COSTS) for name, run in runs.items()]

    # A gradient uses up a frame's lists: both counts are of frames of their own.
    @cached_property
    def entries(self) -> int:
        """Pairs of a splat and a tile."""
        return self._forward().lists.n_entries

    @property
    def pixels(self) -> int:
        """Pixels of the image."""
        return self.size**2

    @cached_property
    def lanes(self) -> tuple[int, int]:
        """Lanes that are evaluated, and those of them in which the splat counted."""
        return _count_lanes(self.device, self._forward())

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        evaluated, used = self.lanes
        counts = {"entries": self.entries, "lanes": evaluated, "lane_use": used / evaluated}
        return {"name": self.name, "count": self.count, "size": self.size, **counts}


def _count_lanes(device: rift.Device, frame: Frame) -> tuple[int, int]:
    lists, tile = frame.lists, frame.raster_pass.settings.edge
    starts, splat = device.get(lists.starts), device.get(lists.entries)[:, 0]
    last, (height, width) = device.get(frame.raster.last), frame.camera.size
    screen = device.get(frame.projection.screen)
    evaluated = used = 0
    for number in range(len(starts) - 1):
        y0, x0 = number // lists.tiles.across * tile, number % lists.tiles.across * tile
        ends = last[y0 : min(y0 + tile, height), x0 : min(x0 + tile, width)]
        drawn = np.arange(ends.max())
        listed = screen[splat[starts[number] + drawn]]
        whole = np.zeros((tile, tile), ends.dtype)
        whole[: ends.shape[0], : ends.shape[1]] = ends
        deepest = whole.reshape(tile // _ROWS, _ROWS, tile // _COLUMNS, _COLUMNS).max(axis=(1, 3))
        met = _touch(listed.astype(float), (y0, x0), tile) & (drawn[:, None, None] < deepest)
        evaluated += _ROWS * _COLUMNS * int(met.sum())
        used += _count_used(listed, drawn, ends, (y0, x0))
    return evaluated, used


def _touch(screen: Any, corner: tuple[int, int], tile: int) -> Any:
    """Whether splats touch the blocks of a tile, (splats, rows of blocks, columns of blocks).

    The bounds are those of ``kernels/include/raster/screen_record.h``.
    """
    mean_x, mean_y, a, b, c, _, across, down = (column[:, None] for column in screen.T)
    begin = _COLUMNS * np.arange(tile // _COLUMNS) + 0.5 + corner[1] - mean_x
    low, high = np.maximum(begin, -across), np.minimum(begin + _COLUMNS - 1, across)
    summit, reach = -b / a * down, down * np.sqrt(np.maximum(1 - b * b / (a * c), 0))

    def edge(sign: int) -> Any:
        u = np.minimum(np.maximum(sign * summit, low), high)
        half = reach * np.sqrt(np.maximum(1 - (u / across) ** 2, 0))
        return (mean_y - corner[0] - b / c * u + sign * half)[:, None]

    rows = (_ROWS * np.arange(tile // _ROWS) + 0.5)[:, None]
    within = (edge(-1) <= rows + _ROWS - 1) & (edge(1) >= rows)
    return within & (low <= high)[:, None]


def _count_used(screen: Any, drawn: Any, ends: Any, corner: tuple[int, int]) -> int:
    y, x = (np.arange(n) + first + 0.5 for n, first in zip(ends.shape, corner, strict=True))
    mean_x, mean_y, a, b, c, weight = (column[:, None, None] for column in screen[:, :6].T)
    dx, dy = mean_x - x, mean_y - y[:, None]
    sigma = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
    counts = (weight * np.exp(-sigma) >= 1 / 255) & (drawn[:, None, None] < ends)
    return int(counts.sum())


def _bytes_only(unit: str, count: Callable[[SplatCase], float], each: int, what: str) -> Cost:
    formula = f"bytes: {each} per {unit} ({what})"
    return Cost(unit, 0, count, lambda case: each * count(case), formula)


def _n(case: SplatCase) -> float:
    return case.count


def _m(case: SplatCase) -> float:
    return case.entries


def _pixels(case: SplatCase) -> float:
    return case.pixels


def _raster(flops: int, what: str) -> Cost:
    record = 4 * (MOMENTS + 3)

    def moved(case: SplatCase) -> float:
        written = record if flops == _BACKWARD else 0
        return case.entries * (8 + 52 + written) + 20 * case.pixels

    formula = f"{flops} flop per lane; bytes: {what}"
    return Cost("lane", flops, lambda case: case.lanes[0], moved, formula)


def _light(flops: int, numbers: int, what: str) -> Cost:
    formula = (
        f"{flops} flop per splat and lobe of the light; bytes: {4 * numbers} per splat ({what})"
    )
    return Cost(
        "lobe", flops, lambda case: case.count * _LOBES, lambda c: 4 * numbers * c.count, formula
    )


SPLAT_COSTS: dict[str, Cost] = {
    "splat_project": _bytes_only("splat", _n, 44 + 57, "parameters in, screen and box out"),
    "splat_shade": _bytes_only("splat", _n, 12 + 192 + 12, "harmonics in, colour out"),
    "tile_count": _bytes_only("splat", _n, 76, "screen, box, depth in, tiles and key out"),
    "radix_count_cpu": _bytes_only("splat", _n, 4 * 4, "keys in, four passes"),
    "radix_count_gpu": _bytes_only("splat", _n, 4 * 4, "keys in, four passes"),
    "radix_scatter_cpu": _bytes_only("splat", _n, 4 * 16, "keys and order in and out, four passes"),
    "radix_scatter_gpu": _bytes_only("splat", _n, 4 * 16, "keys and order in and out, four passes"),
    "radix_sort_cpu": _bytes_only("splat", _n, 5 * 16, "keys and order in and out, five times"),
    "scan_sum_cpu": _bytes_only("splat", _n, 4, "counts in"),
    "scan_sum_gpu": _bytes_only("splat", _n, 4, "counts in"),
    "scan_place_cpu": _bytes_only("splat", _n, 8, "counts in, offsets out"),
    "scan_place_gpu": _bytes_only("splat", _n, 8, "counts in, offsets out"),
    "tile_ranks": _bytes_only("splat", _n, 56, "order and tiles in and out"),
    "tile_histogram_cpu": _bytes_only("entry", _m, 4, "tiles counted"),
    "tile_histogram_gpu": _bytes_only("entry", _m, 4, "tiles counted"),
    "tile_sums_gpu": _bytes_only("entry", _m, 4, "counts in"),
    "tile_offsets": _bytes_only("entry", _m, 4, "counts to offsets"),
    "tile_places_gpu": _bytes_only("entry", _m, 8, "counts in, offsets out"),
    "tile_scatter_cpu": _bytes_only("entry", _m, 12, "offsets in, entries out"),
    "tile_scatter_gpu": _bytes_only("entry", _m, 12, "offsets in, entries out"),
    "slot_seen": _bytes_only("entry", _m, 8, "entries in, marks out"),
    "slot_number": _bytes_only("entry", _m, 16, "numbers in and out"),
    "splat_pack": _bytes_only("splat", _n, 32 + 12 + 64, "screen and colours in, records out"),
    "splat_raster_cpu": _raster(_FORWARD, "each entry's splat, the image"),
    "splat_raster_gpu": _raster(_FORWARD, "each entry's splat, the image"),
    "splat_raster_grad_cpu": _raster(_BACKWARD, "each entry's splat and record, the image"),
    "splat_raster_grad_gpu": _raster(_BACKWARD, "each entry's splat and record, the image"),
    "splat_sum_slots": _bytes_only("entry", _m, 36, "records in; the splats' sums are fewer"),
    "splat_project_grad": _bytes_only("splat", _n, 44 + 36 + 132, "sums in, gradients out"),
    "copy_columns": _bytes_only("splat", _n, 8, "depth in and out"),
    "expected_depth": _bytes_only("pixel", _pixels, 12, "depth and transmittance in, depth out"),
    "expected_depth_grad": _bytes_only("pixel", _pixels, 48, "images in and out"),
    "splat_shade_grad": _bytes_only("splat", _n, 12 + 192 + 24 + 192, "harmonics in and out"),
    "sum_columns": _bytes_only("splat", _n, 1, "a row of the camera for 64 splats"),
    "light_lobes": _bytes_only("lobe", lambda case: _LOBES, 24 + 32, "axes and light in, rows out"),
    "light_shade": _light(26, 17, "position, normal and reflectance in, light out"),
    "light_shade_grad": _light(44, 44, "the same and colours in, gradients and arrivals out"),
    "light_grad": _light(24, 8, "arrivals in"),
    "background_grad": _bytes_only("pixel", _pixels, 16, "gradient and transmittance in"),
    **TRAINING_COSTS,
}
