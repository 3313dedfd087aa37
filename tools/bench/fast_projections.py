"""The projector by the Fourier slice theorem: what its kernels have to do.

A cost asks a case for the sizes that follow from the geometry and the error: ``length`` of a view's
transform, ``samples`` of a ray, ``width`` of the gridding's kernel, and ``edges`` of the padded
image. Padding to whole lanes and columns beside the half spectrum are not counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rift_cl as rift
from bench.case import Case
from bench.costs import Cost
from bench.operations import Task
from bench.row_filters import ROW_COSTS
from bench.transform_work import transform_bytes, transform_flops
from rift_cl.operators import FastProjector

_ERROR, _SLICES = 1e-3, 4


@dataclass(frozen=True)
class FastCase:
    """A case and the sizes of its transforms.

    Args:
        case: the geometry.
        error: what the projector was asked for.
        length: samples of a view's transform.
        samples: of a ray, from zero on, on average.
        width: cells that the gridding's kernel reaches along an axis.
        edges: of the padded image along (y, x).
    """

    case: Case
    error: float
    length: int
    samples: int
    width: int
    edges: tuple[int, int]

    @property
    def name(self) -> str:
        """How tables call it."""
        return f"{self.case.name}, error {self.error:g}"

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        names = ("name", "error", "length", "samples", "width", "edges")
        return {**self.case.record(), **{name: getattr(self, name) for name in names}}

    @property
    def ray_samples(self) -> float:
        """Complex samples of all rays."""
        return self.case.views * self.samples

    @property
    def cells(self) -> float:
        """Pairs of a ray's sample and a cell that its kernel reaches."""
        return self.ray_samples * self.width**2

    @property
    def half_spectrum(self) -> float:
        """Complex cells of the grid."""
        return self.edges[0] * (self.edges[1] // 2 + 1)

    @property
    def folded(self) -> float:
        """Complex samples of pairs of rows, padded along x alone."""
        return self.case.n / 2 * self.edges[1]

    @property
    def image_rows(self) -> float:
        """Complex cells of the grid's rows that an image row stands in."""
        return self.case.n * (self.edges[1] // 2 + 1)

    def transforms(self, work: Callable[[int], float]) -> float:
        """The work of all transforms: of pairs of views, of columns, of pairs of rows."""
        rows, edge = self.edges
        views = self.case.views / 2 * work(self.length)
        return views + (edge // 2 + 1) * work(rows) + self.case.n / 2 * work(edge)


def _views_and_rays(case: FastCase) -> float:
    return 4 * case.case.views * (case.case.bins + case.length)


def _rays_and_grid(case: FastCase) -> float:
    return 8 * (case.ray_samples + case.half_spectrum)


_WEIGH_FLOP = 78
_PACK = "no arithmetic; bytes: bins on one side, samples of the transform on the other"
_WEIGH = (
    "78 flop per sample of a ray: told apart from its pair 2, the response's four sines and their "
    "products 70, complex product 6; bytes: views' transforms on one side, rays on the other"
)
_CELL = (
    "per cell that a sample's kernel reaches 4 flop, a multiply-add each for the real and the "
    "imaginary part, and 8 / width for weights; bytes: rays and grid"
)
_PACKING = Cost("bin", 0, lambda c: c.case.views * c.case.bins, _views_and_rays, _PACK)
_WEIGHING = Cost(
    "sample",
    _WEIGH_FLOP,
    lambda c: c.ray_samples,
    lambda c: 4 * c.case.views * c.length + 8 * c.ray_samples,
    _WEIGH,
)


_REGULAR: dict[str, Cost] = {
    "rays_of_views_cpu": Cost(
        "flop",
        1,
        lambda c: c.case.views / 2 * transform_flops(c.length) + _WEIGH_FLOP * c.ray_samples,
        lambda c: 4 * c.case.views * c.case.bins + 8 * c.ray_samples,
        "transforms of pairs of views, and 78 flop per sample of a ray; bytes: views in, rays out",
    ),
    "pairs_of_spectrum_cpu": Cost(
        "flop",
        1,
        lambda c: (c.edges[1] // 2 + 1) * transform_flops(c.edges[0]) + 2 * c.folded,
        lambda c: 8 * (c.half_spectrum + c.folded),
        "transforms of columns, and 2 flop per sample of a pair of rows; bytes: grid in, pairs out",
    ),
    "slice_of_pairs_cpu": Cost(
        "flop",
        1,
        lambda c: c.case.n / 2 * transform_flops(c.edges[1]) + 2 * c.case.n**2,
        lambda c: 8 * c.folded + 4 * c.case.n**2,
        "transforms of pairs of rows, and two weights per pixel; bytes: pairs in, pixels out",
    ),
    "rays_pack_gpu": _PACKING,
    "rays_unpack": _PACKING,
    "rays_weigh_gpu": _WEIGHING,
    "rays_unweigh": _WEIGHING,
    "fft_pass": ROW_COSTS["fft_pass"]._replace(
        units=lambda c: c.transforms(transform_flops),
        bytes=lambda c: c.transforms(transform_bytes),
    ),
    "spectrum_mirror": Cost(
        "cell",
        0,
        lambda c: 2 * c.width * c.edges[0],
        lambda c: 16 * 2 * c.width * c.edges[0],
        "no arithmetic; bytes: as many cells as the kernel is wide, at both ends of a row",
    ),
    "spectrum_fold_gpu": Cost(
        "sample",
        2,
        lambda c: c.folded,
        lambda c: 8 * (c.image_rows + c.folded),
        "2 flop per sample of a pair of rows; bytes: the rows' half spectra in, pairs out",
    ),
    "spectrum_unfold": Cost(
        "sample",
        2,
        lambda c: c.folded,
        lambda c: 8 * (c.folded + c.half_spectrum),
        "2 flop per sample of a pair of rows; bytes: pairs in, the grid out, zeros included",
    ),
    "slice_crop_gpu": Cost(
        "pixel",
        2,
        lambda c: c.case.n**2,
        lambda c: 8 * c.case.n**2,
        "2 flop per pixel: two weights; bytes: pixels in and out",
    ),
    "slice_place": Cost(
        "pixel",
        2,
        lambda c: c.case.n**2,
        lambda c: 4 * c.case.n**2 + 8 * c.folded,
        "2 flop per pixel: two weights; bytes: pixels in, padded rows out",
    ),
}


def fast_costs(width: int) -> dict[str, Cost]:
    """Costs for a kernel of so many cells along an axis."""
    cell = Cost("cell", 4 + 8 / width, lambda c: c.cells, _rays_and_grid, _CELL)
    kernels = {"rays_spread": cell, "rays_spread_stack_cpu": cell, "rays_read": cell}
    return {name: _of_all(cost) for name, cost in {**_REGULAR, **kernels}.items()}


def _of_all(cost: Cost) -> Cost:
    """What all slices cost, of what one does."""
    return cost._replace(
        units=lambda c: c.case.slices * cost.units(c), bytes=lambda c: c.case.slices * cost.bytes(c)
    )


FAST_COSTS = fast_costs(8)


def fast_tasks(device: rift.Device, n: int, views: int) -> list[Task]:
    """Both directions of a slice, and a stack's backprojection."""
    forward, backward = (_task(device, Case(n, views), way) for way in ("forward", "backward"))
    return [forward, backward, _task(device, Case(n, views, _SLICES), "backward")]


def _task(device: rift.Device, case: Case, way: str) -> Task:
    A = FastProjector(case.grid, case.scan, _ERROR, device=device)
    A.prepare()
    gridding = A.gridding
    samples = round(sum(A.samples) / len(A.samples))
    sizes = FastCase(case, _ERROR, A.period, samples, gridding.width, gridding.edges)
    if way == "forward":
        given, operator = device.array(case.image), A
    else:
        given, operator = device.array(case.projections), A.T
    name = way if case.slices == 1 else f"{way}, {case.slices} slices"
    return Task(name, sizes, lambda: operator(given), fast_costs(sizes.width))
