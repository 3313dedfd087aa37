"""Projectors of beams from a point: what the kernels of cones, vectors and fans have to do.

A cost asks a case for the updates, a voxel in a view, for the numbers of the volume and of the
data, and for those of the tables that views are stretched to. Updates take a share of two columns
of a table each; those that take a third, since a voxel's shadow is wider than a bin, count no more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import rift_cl as rift
from bench.costs import Cost
from bench.operations import Task
from rift_cl.operators.projector.cone.rectification import Rectification
from rift_cl.reconstruct.direct.ray_factors import RayFactors
from rift_cl.reconstruct.direct.upright_views import upright_cone

_FAR, _MAGNIFICATION, _TILT = 3.0, 1.5, 0.02


@dataclass(frozen=True)
class ConeCase:
    """A cube, or a square, of samples of size 1 that a beam from a point sees as large as itself.

    Args:
        n: samples along a side, and bins along a side of the detector.
        views: number of views, over a full turn.
        kind: ``cone``, ``vectors`` (a cone of which the detector is tilted) or ``fan``.
    """

    n: int
    views: int
    kind: str = "cone"

    @property
    def name(self) -> str:
        """How tables call it."""
        return f"{self.kind}, {self.n}{'²' if self.kind == 'fan' else '³'} × {self.views} views"

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        names = ("name", "n", "views", "kind")
        return {**{name: getattr(self, name) for name in names}, "updates": self.updates}

    @property
    def grid(self) -> rift.Grid:
        """What is looked at."""
        return rift.Grid((self.n,) * (2 if self.kind == "fan" else 3))

    @property
    def scan(self) -> Any:
        """How it is looked at."""
        distance = _FAR * self.n
        reach = _MAGNIFICATION * distance
        pitch = 1.02 * 2 * reach * math.tan(math.asin(0.5 / _FAR)) / self.n
        angles = np.arange(self.views) * 2 * np.pi / self.views
        if self.kind == "fan":
            return rift.Fan(angles, self.n, pitch, distance, reach)
        cone = rift.Cone(angles, self.n, self.n, pitch, distance, reach)
        if self.kind == "cone":
            return cone
        v = cone.vectors()
        rolled = v.down + _TILT * v.across
        return rift.Vectors(v.source, v.middle, v.across, rolled, v.rows, v.bins)

    @property
    def samples(self) -> float:
        """Of the volume."""
        return float(math.prod(self.grid.shape))

    @property
    def pixels(self) -> float:
        """Of all views."""
        return float(self.views * self.n ** (len(self.grid.shape) - 1))

    @property
    def updates(self) -> float:
        """A sample in a view each."""
        return self.samples * self.views

    @property
    def places(self) -> float:
        """Of a slab's samples along either axis of a table."""
        return 2.0 * self.n**2 * self.views


def _volume_and_data(case: ConeCase) -> float:
    return 4 * (case.samples + case.pixels)


_UPDATE = Cost(
    "update",
    4,
    lambda c: c.updates,
    _volume_and_data,
    "4 flop per update (a voxel in a view): two blended columns, a multiply-add each; the blend of "
    "rows, as much for each voxel and column that it is seen in, is not counted; bytes: the volume "
    "and the tables, which are as large as the data",
)
_STRETCH = Cost(
    "pixel",
    40,
    lambda c: c.pixels,
    lambda c: 8 * c.pixels,
    "40 flop per pixel: four rows, a cubic weight and a multiply-add each; bytes: data and tables",
)
_UPRIGHT = Cost(
    "pixel",
    112,
    lambda c: c.pixels,
    lambda c: 8 * c.pixels,
    "112 flop per pixel: eight cubic weights and 16 multiply-adds; bytes: data on both sides",
)
# Between bins, of which there are then twice as many.
_BETWEEN = _UPRIGHT._replace(units=lambda c: 2 * c.pixels, bytes=lambda c: 12 * c.pixels)
_RAY = Cost(
    "update",
    20,
    lambda c: c.updates,
    lambda c: 4 * (2 * c.samples + c.pixels),
    "20 flop per update (a pixel in a view): its place, two edges' shares and multiply-adds; "
    "bytes: the image by rows and by columns, and the data",
)

CONE_COSTS: dict[str, Cost] = {
    "slab_backproject_cpu": _UPDATE,
    "slab_backproject_gpu": _UPDATE,
    "slab_project_cpu": _UPDATE,
    "slab_project_gpu": _UPDATE,
    "slab_stretch": _STRETCH,
    "slab_stretch_adjoint": _STRETCH,
    "slab_places": Cost(
        "place",
        24,
        lambda c: c.places,
        lambda c: 12 * c.places,
        "24 flop per place: two ratios of linear forms, and the overlaps; bytes: a number and two "
        "shares written",
    ),
    "volume_turn": Cost(
        "voxel", 0, lambda c: c.samples, lambda c: 8 * c.samples, "no arithmetic; bytes: both sides"
    ),
    "upright_read": _UPRIGHT,
    "upright_spread": _UPRIGHT,
    "spline_coefficients": Cost(
        "pixel",
        56,
        lambda c: c.pixels,
        lambda c: 8 * c.pixels,
        "56 flop per pixel: 13 multiply-adds to either side; bytes: both sides",
    ),
    "fan_backproject": _RAY,
    "fan_project": _RAY,
    "fan_records": Cost(
        "bin",
        8,
        lambda c: c.pixels,
        lambda c: 20 * c.pixels,
        "8 flop per bin; bytes: bins, records",
    ),
    "rays_weigh": Cost(
        "bin", 2, lambda c: c.pixels, lambda c: 8 * c.pixels, "2 flop per bin; bytes: both sides"
    ),
}
# What a fan does besides, as projectors of parallel beams do.
_PLANES: dict[str, Cost] = {
    "plane_split": Cost(
        "pixel", 0, lambda c: 2 * c.samples, lambda c: 16 * c.samples, "no arithmetic; two planes"
    ),
    "plane_merge": Cost(
        "pixel", 1, lambda c: c.samples, lambda c: 12 * c.samples, "1 flop per pixel; two planes"
    ),
}


def upright_reading(device: rift.Device, case: ConeCase) -> Rectification:
    """What filtered backprojection reads of tilted detectors."""
    cone, forms = upright_cone(case.scan)
    upright, shape = (cone.rows, cone.bins), (case.n, case.n)
    views, kind = np.arange(case.views, dtype=np.int32), np.dtype(np.float32)
    return Rectification(device, upright, shape, views, forms, kind, spline=True)


def cone_tasks(device: rift.Device, n: int, views: int) -> Iterator[Task]:
    """Both halves of every kind, and the weights of rays of filtered backprojection.

    Args:
        device: where to work.
        n: samples along a side of a slice that a fan sees; a volume has a quarter.
        views: of the fan; the others have a quarter.
    """
    for case in (
        ConeCase(n, views, "fan"),
        ConeCase(n // 4, views // 4),
        ConeCase(n // 4, views // 4, "vectors"),
    ):
        A = rift.Projector(case.grid, case.scan, device=device)
        random = np.random.default_rng(1)
        x = device.array(random.random(A.domain, np.float32))
        y = device.array(random.random(A.range, np.float32))
        yield Task(f"{case.kind}, forward", case, partial(A, x), {**CONE_COSTS, **_PLANES})
        yield Task(f"{case.kind}, backward", case, partial(A.T, y), {**CONE_COSTS, **_PLANES})
        if case.kind == "vectors":
            reading = upright_reading(device, case)
            out = device.empty((case.views, *reading.shape))
            run = partial(reading.read, y, out, 0, case.views)
            costs = {**CONE_COSTS, "upright_read": _BETWEEN}
            yield Task("vectors, read as upright views", case, run, costs)
        if case.kind == "cone":
            ones = np.ones((1, case.n))
            weights, out = RayFactors(device, np.float32, ones, ones), device.empty(A.range)
            yield Task("cone, weights of rays", case, partial(weights.widen, y, out), CONE_COSTS)
