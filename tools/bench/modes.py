"""Splats with modes and lobes: rendering, its gradient, voxels, and what each kernel has to do.

The scene is that of ``bench.splats`` with a density of order 2, colours of order 1 and lobes of
Laguerre-Gaussians. Compositing is counted in the lanes that the Gaussian scene evaluates: a splat
with modes reaches farther, which is a price of the modes and no necessary work.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import rift_cl as rift
from bench.costs import Cost
from bench.operations import Task
from bench.splats import SPLAT_COSTS, SplatCase
from rift_cl.basis import n_coeff
from rift_cl.splat import Frame, Renderer, Splats, SplatSettings, voxelise
from rift_cl.splat.projection import moment_count, table_width

SHAPE_ORDER, COLOR_ORDER = 2, 1
_FUNCTIONS, _GEOMETRY, _CHANNELS = 8, 5, 3
# Beside a Gaussian's: two operations for each order of each polynomial, and for each moment.
_FORWARD = 32 + 2 * (SHAPE_ORDER + _CHANNELS * COLOR_ORDER)
_BACKWARD = 62 + 2 * (SHAPE_ORDER + 2 + _CHANNELS * COLOR_ORDER)


@dataclass(frozen=True)
class ModeCase(SplatCase):
    """The scene with modes, and a grid of voxels round it.

    Args:
        edge: voxels along each side.
    """

    edge: int = 64

    @property
    def name(self) -> str:
        """How tables call it."""
        return f"{super().name}, modes, {self.edge}³ voxels"

    @cached_property
    def splats(self) -> Splats:
        """Gaussians with modes and lobes, on the device."""
        random = np.random.default_rng(3)

        def noise(*shape: int) -> Any:
            return 0.1 * random.normal(size=shape).astype(np.float32)

        lobes = noise(self.count, _GEOMETRY)
        lobes[:, 0] += 1
        lobes[:, 4] = np.log(0.5)
        given = {name: array for name, array in self.parameters.items() if name != "sh"}
        return Splats.upload(
            self.device,
            **given,
            sh=noise(self.count, _FUNCTIONS, 3),
            shape_modes=noise(self.count, n_coeff(SHAPE_ORDER, 3) - 1),
            color_modes=noise(self.count, n_coeff(COLOR_ORDER, 3) - 1, _CHANNELS),
            lobes=lobes,
        )

    @cached_property
    def gaussians(self) -> SplatCase:
        """The same scene without modes."""
        return SplatCase(self.count, self.size, self.device)

    @property
    def lanes(self) -> tuple[int, int]:
        """Lanes that the Gaussian scene evaluates, and those in which a splat counted."""
        return self.gaussians.lanes

    @property
    def grid(self) -> rift.Grid:
        """Voxels of the cube that the splats fill."""
        return rift.Grid((self.edge,) * 3, spacing=2.2 / self.edge)

    @cached_property
    def renderer(self) -> Renderer:
        """Draws lobes."""
        return Renderer(SplatSettings(angular="lg"), device=self.device)

    @cached_property
    def tasks(self) -> list[Task]:
        """What is done with the scene, on device arrays."""
        grad, device = self.device.array(self.grad_image), self.device
        runs = {
            "draw with modes": self._forward,
            "gradient with modes": lambda: self.renderer.backward(
                self.frame, grad, with_camera=True
            ),
            "voxels": lambda: voxelise(device, self.splats, self.grid),
        }
        return [Task(name, self, run, MODE_COSTS) for name, run in runs.items()]

    def _forward(self) -> Frame:
        return self.renderer.forward(self.splats, self.camera)

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        return {**super().record(), "edge": self.edge}


def mode_tasks(device: rift.Device, count: int, size: int) -> Iterator[Task]:
    """Rendering with modes, its gradient and voxels."""
    yield from ModeCase(count, size, device).tasks


def _per_splat(numbers: int, what: str) -> Cost:
    return Cost(
        "splat",
        0,
        lambda c: c.count,
        lambda c: 4 * numbers * c.count,
        f"bytes: {4 * numbers} per splat ({what})",
    )


def _raster(flops: int, record: bool) -> Cost:
    def moved(case: ModeCase) -> float:
        row = 8 + _CHANNELS + table_width(case.splats)
        written = moment_count(case.splats, _CHANNELS) if record else 0
        return case.entries * (8 + 4 * (row + written)) + 20 * case.pixels

    what = "each entry's splat and its modes" + (" and record" if record else "")
    formula = f"{flops} flop per lane; bytes: {what}, the image"
    return Cost("lane", flops, lambda c: c.lanes[0], moved, formula)


_SPACE = n_coeff(SHAPE_ORDER, 3) - 1 + _CHANNELS * (n_coeff(COLOR_ORDER, 3) - 1)
_SCREEN = 3 + n_coeff(SHAPE_ORDER, 2) - 1 + _CHANNELS * (n_coeff(COLOR_ORDER, 2) - 1)
_MOMENTS = n_coeff(SHAPE_ORDER + 2, 2) + _CHANNELS * n_coeff(COLOR_ORDER, 2)
_LOBE = 3 * _FUNCTIONS + _GEOMETRY

MODE_COSTS: dict[str, Cost] = {
    **SPLAT_COSTS,
    "hermite_project": _per_splat(10 + _SPACE + _SCREEN, "parameters and modes in, table out"),
    "hermite_project_grad": _per_splat(
        10 + 2 * _SPACE + _SCREEN + _MOMENTS + 6 + _CHANNELS + 6,
        "parameters, modes, table and moments in, gradients and sums out",
    ),
    "splat_raster_cpu": _raster(_FORWARD, False),
    "splat_raster_gpu": _raster(_FORWARD, False),
    "splat_raster_grad_cpu": _raster(_BACKWARD, True),
    "splat_raster_grad_gpu": _raster(_BACKWARD, True),
    "lobe_shade": _per_splat(3 + _LOBE + 3, "position, coefficients and lobes in, colour out"),
    "lobe_shade_grad": _per_splat(6 + 2 * _LOBE + 6, "the same and gradients, in and out"),
    "hermite_dilate": _per_splat(
        11 + n_coeff(SHAPE_ORDER, 3) - 1 + 12 + n_coeff(SHAPE_ORDER, 3) + 3,
        "parameters and modes in, a row of the table and sides of a box out",
    ),
    "hermite_voxelise": Cost(
        "voxel",
        0,
        lambda c: c.edge**3,
        lambda c: 4 * (c.edge**3 + c.count * (12 + n_coeff(SHAPE_ORDER, 3))),
        "bytes: the splats' rows in, the volume out",
    ),
}
