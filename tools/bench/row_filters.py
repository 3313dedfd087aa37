"""Filters along the detector: what their kernels have to do, and the sizes they are measured at.

A cost here asks a case for its ``rows`` of ``bins`` numbers of ``itemsize`` bytes, and for how many
``filters`` they share.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import rift_cl as rift
from bench.costs import Cost
from bench.operations import Task
from bench.transform_work import transform_bytes, transform_flops
from rift_cl.operators import Ramp, ViewFilter
from rift_cl.operators.filters.row_convolution import SHORT_ROW
from rift_cl.operators.fourier.row_transform import transform_length


def _samples(case: Any) -> float:
    return case.rows * case.bins


def _spectrum(case: Any) -> float:
    """Complex samples of all transforms; two bins, or two zeros, make one."""
    return case.rows * transform_length(case.bins)


def _weighing_bytes(case: Any) -> float:
    responses = (transform_length(case.bins) // 2 + 1) * case.filters
    return case.itemsize * (4 * _spectrum(case) + 2 * responses)


ROW_COSTS: dict[str, Cost] = {
    "rows_filter_cpu": Cost(
        "flop",
        1,
        lambda c: 2 * c.rows * transform_flops(transform_length(c.bins)) + 16 * _spectrum(c),
        lambda c: 2 * c.itemsize * _samples(c),
        "two transforms, 168, 98, 34, 28, 10 flop per butterfly of radix 9, 8, 4, 3, 2, and 16 "
        "flop per complex sample for the response; bytes: the rows in and out",
    ),
    "filter_views": Cost(
        "MAC",
        2,
        lambda c: _samples(c) * c.bins,
        lambda c: 2 * c.itemsize * _samples(c),
        "2 flop per MAC, bins² of them to a detector row; bytes: the sinogram in and out",
    ),
    "rows_pack_gpu": Cost(
        "bin",
        0,
        _samples,
        lambda c: c.itemsize * (_samples(c) + 2 * _spectrum(c)),
        "no arithmetic; bytes: the rows in, the transform's samples out, zeros included",
    ),
    "fft_pass": Cost(
        "flop",
        1,
        lambda c: 2 * c.rows * transform_flops(transform_length(c.bins)),
        lambda c: 2 * c.rows * transform_bytes(transform_length(c.bins), c.itemsize),
        "168, 98, 34, 28, 10 flop per butterfly of radix 9, 8, 4, 3, 2; bytes: each pass reads and "
        "writes every sample",
    ),
    "rows_weigh_gpu": Cost(
        "complex sample",
        16,
        _spectrum,
        _weighing_bytes,
        "32 flop per pair of samples k and length - k: even and odd bins told apart, turned, "
        "weighed, put together; bytes: the samples in and out, the responses in",
    ),
    "rows_unpack_gpu": Cost(
        "bin",
        1,
        _samples,
        lambda c: 2 * c.itemsize * _samples(c),
        "1 flop per bin (the view's gain); bytes: the rows in and out",
    ),
}


@dataclass(frozen=True)
class FilterCase:
    """A sinogram whose rows are filtered.

    Args:
        rows: views.
        bins: of each.
        filters: 1 for a ramp that all views share, or as many as there are rows.
        dtype: of the rows.
    """

    rows: int
    bins: int
    filters: int = 1
    dtype: str = "float32"

    @property
    def name(self) -> str:
        """How tables call it."""
        kind = "one filter" if self.filters == 1 else "a filter each"
        double = "" if self.dtype == "float32" else f", {self.dtype}"
        return f"{self.rows} × {self.bins}, {kind}{double}"

    @property
    def itemsize(self) -> int:
        """Bytes of a number."""
        return np.dtype(self.dtype).itemsize

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        return {"name": self.name, **asdict(self)}

    def run(self, device: rift.Device) -> Callable[[], Any]:
        """The operation, its filter designed, on arrays of the device."""
        angles = np.linspace(0, np.pi, self.rows, endpoint=False)
        scan = rift.Parallel(angles, self.bins)
        gains = None if self.filters == 1 else _gains(self.rows)
        F = ViewFilter(scan, Ramp(), gains=gains, device=device, dtype=self.dtype)
        random = np.random.default_rng(0)
        y = device.array(random.standard_normal(F.domain), self.dtype)
        return lambda: F(y)


def _gains(views: int) -> Callable[[Any], Any]:
    """Gains that grow with frequency, faster in each view: what they are does not matter here."""
    slopes = np.linspace(1, 2, views)
    return lambda frequencies: 1 + slopes[:, None] * frequencies


def filter_tasks(device: rift.Device, views: int, bins: int) -> Iterator[Task]:
    """A sinogram as it comes, one four times as large, and short rows.

    Args:
        device: where to work.
        views: of the first.
        bins: of the first.
    """
    large = 4 * views, max(64, 1 << (4 * bins).bit_length() - 1)
    cases = [FilterCase(4 * views, min(SHORT_ROW, bins))]
    for rows, wide in ((views, bins), large):
        cases += [FilterCase(rows, wide), FilterCase(rows, wide, rows)]
    if device.traits.fp64:
        cases.append(FilterCase(views, bins, views, "float64"))
    for case in cases:
        yield Task(case.name, case, case.run(device), ROW_COSTS)
