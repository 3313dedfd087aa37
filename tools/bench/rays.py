"""Fans, cones and tilted detectors: both directions of their projectors, on one small volume.

Operations of these kernels are not counted yet: a cost here is the bytes that have to be moved, and
a kernel that reads and writes them as fast as the device can is as fast as it may be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import rift_cl as rift
from bench.costs import Cost
from bench.operations import Task

_ROLL = 0.05
Scan = rift.Fan | rift.Cone | rift.Vectors


@dataclass(frozen=True)
class RayCase:
    """A scan and the grid that it sees.

    Args:
        kind: fan, cone or tilted cone.
        grid: of an image or a volume.
        scan: its views.
    """

    kind: str
    grid: rift.Grid
    scan: Scan
    itemsize = 4

    @property
    def name(self) -> str:
        """How tables call it."""
        edges = " × ".join(map(str, self.grid.shape))
        return f"{self.kind}, {edges}, {self.scan.views} views"

    @property
    def samples(self) -> float:
        """Samples of the image or the volume."""
        return float(np.prod(self.grid.shape))

    @property
    def rays(self) -> float:
        """Rays of all views."""
        return float(self.scan.views * self.scan.bins * getattr(self.scan, "rows", 1))

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        shape = list(self.grid.shape)
        return {"name": self.name, "kind": self.kind, "shape": shape, "views": self.scan.views}


def _moved(unit: str, samples: int, rays: int, formula: str) -> Cost:
    """So many arrays of the size of the volume, and so many of that of the data."""
    return Cost(
        unit,
        0,
        lambda case: case.samples if unit == "sample" else case.rays,
        lambda case: case.itemsize * (samples * case.samples + rays * case.rays),
        f"operations are not counted; bytes: {formula}",
    )


_BOTH = "samples and rays, each once"
_RAYS = "rays in and out"
RAY_COSTS: dict[str, Cost] = {
    "fan_records": _moved("ray", 0, 5, "rays in, records of four numbers out"),
    "fan_project": _moved("sample", 1, 1, _BOTH),
    "fan_backproject": _moved("sample", 1, 4, "records of four numbers in, the image out"),
    "slab_places": _moved("ray", 0, 0, "none of samples or rays: places are found from angles"),
    **{f"slab_project_{kind}": _moved("sample", 1, 1, _BOTH) for kind in ("cpu", "gpu")},
    **{f"slab_backproject_{kind}": _moved("sample", 1, 1, _BOTH) for kind in ("cpu", "gpu")},
    "slab_stretch": _moved("ray", 0, 2, _RAYS),
    "slab_stretch_adjoint": _moved("ray", 0, 2, _RAYS),
    "upright_read": _moved("ray", 0, 2, _RAYS),
    "upright_spread": _moved("ray", 0, 2, _RAYS),
    "plane_split": _moved("sample", 3, 0, "the image in, two planes out"),
    "volume_turn": _moved("sample", 2, 0, "samples in and out"),
}


def ray_tasks(device: rift.Device, n: int, views: int) -> Iterator[Task]:
    """Both directions of every kind of scan that is not parallel.

    Args:
        device: where to work.
        n: samples along a side.
        views: views over a full turn.
    """
    for case in _cases(n, views):
        A = rift.Projector(case.grid, case.scan, device=device)
        x = device.array(np.ones(A.domain, np.float32))
        y = device.array(np.ones(A.range, np.float32))
        yield Task(f"forward, {case.name}", case, lambda A=A, x=x: A(x), RAY_COSTS)
        yield Task(f"backward, {case.name}", case, lambda A=A, y=y: A.T(y), RAY_COSTS)


def _cases(n: int, views: int) -> Iterator[RayCase]:
    angles = np.arange(views) * 2 * np.pi / views
    bins, far = 2 * n, 3.0 * n
    yield RayCase("fan", rift.Grid((n, n)), rift.Fan(angles, bins, 1.5, far, 2 * far))
    cone = rift.Cone(angles, bins, bins, 1.5, far, 2 * far)
    volume = rift.Grid((n, n, n))
    yield RayCase("cone", volume, cone)
    upright = cone.vectors()
    # The detector is rolled in its plane by three degrees.
    across, down = upright.across + _ROLL * upright.down, upright.down - _ROLL * upright.across
    tilted = rift.Vectors(upright.source, upright.middle, across, down, cone.rows, cone.bins)
    yield RayCase("tilted cone", volume, tilted)
