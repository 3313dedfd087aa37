"""Coverage of frequencies by cameras, and its gradient: the planner's kernels.

Only pairs of a view and a frequency in its slab are necessary work; that a pair is none of them has
to be found out, which is not counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rift_cl as rift
from bench.costs import Cost
from bench.operations import Task
from rift_cl import coverage
from rift_cl.geometry import Aperture, Camera, look_at
from rift_cl.sampling import Observations, Target, half_sphere
from rift_cl.sampling.coverage.device import coverage_grad

# Numbers of a view, and beyond how many u = n . k, in cycles per diameter, a slab is over.
_ROW, _REACH = 8, 1.625
_DISTANCE = 5.0


@dataclass(frozen=True)
class CoverageCase:
    """Cameras all round a target of diameter 2, and the upper half of a cube of frequencies.

    Args:
        views: how many cameras.
        edge: frequencies along an edge of the whole cube, half a cycle per diameter apart.
    """

    views: int
    edge: int
    itemsize = 4

    @property
    def name(self) -> str:
        """How tables call it."""
        return f"{self.views} cameras, {self.edge}³ / 2 frequencies"

    @cached_property
    def cameras(self) -> list[Camera]:
        """On half a sphere, with lenses that diffract and are in focus at the target's middle."""
        K = np.array([[1000.0, 0, 512], [0, 1000, 512], [0, 0, 1]])
        lens = Aperture(radius=0.02, focus=_DISTANCE, wavelength=2e-5)
        views = [look_at(_DISTANCE * n, (0, 0, 0), (0.1, 0.2, 1)) for n in half_sphere(self.views)]
        return [Camera((1024, 1024), K, view, aperture=lens) for view in views]

    @cached_property
    def k(self) -> NDArray[np.float64]:
        """(K, 3) cycles per unit of length."""
        axis = (np.arange(self.edge) - self.edge // 2) / 4
        grid = np.meshgrid(axis[self.edge // 2 :], axis, axis, indexing="ij")
        return np.stack([part.ravel() for part in grid[::-1]], axis=1)

    @cached_property
    def pairs(self) -> float:
        """Views and frequencies in their slabs."""
        normals = Observations.of(self.cameras, [(0, 0, 0)]).direction[:, 0]
        return float(sum(np.count_nonzero(np.abs(self.k @ n) * 2 < _REACH) for n in normals))

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        return {"name": self.name, "views": self.views, "edge": self.edge}


COVERAGE_COSTS: dict[str, Cost] = {
    "coverage": Cost(
        "pair in a slab",
        140,
        lambda c: c.pairs,
        lambda c: c.itemsize * (4 * len(c.k) + _ROW * c.views),
        "35 flop for plane and window, 20 for diffraction, 25 for the pixel, 60 for the disc of "
        "defocus; bytes: frequencies and views in, coverage out",
    ),
    "coverage_grad": Cost(
        "pair in a slab",
        260,
        lambda c: c.pairs,
        lambda c: c.itemsize * (4 * len(c.k) + 2 * _ROW * c.views),
        "260 flop: the coverage's, slopes of its three factors, seven sums; bytes: frequencies, "
        "views and the gradient in, a gradient for each view out",
    ),
}


def coverage_tasks(device: rift.Device, views: int, edge: int) -> Iterator[Task]:
    """Coverage and its gradient, as the planner calls them: host arrays in and out."""
    case, target = CoverageCase(views, edge), Target(np.zeros(3), 2.0)
    ones = np.ones((1, len(case.k)))
    yield Task(
        f"coverage, {case.name}",
        case,
        lambda: coverage(case.cameras, target, case.k, device=device),
        COVERAGE_COSTS,
    )
    yield Task(
        f"its gradient, {case.name}",
        case,
        lambda: coverage_grad(case.cameras, target, ones, case.k, device=device),
        COVERAGE_COSTS,
    )
