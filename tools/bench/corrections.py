"""What is done to projections before slices are made of them: stripes, zingers, shifts.

A cost here asks a case for its ``views``, ``rows`` and ``bins``, and for their product, ``size``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rift_cl as rift
from bench.case import Floats
from bench.costs import Cost
from bench.operations import Task
from rift_cl.reconstruct.preprocess.columns import DetectorColumns
from rift_cl.reconstruct.preprocess.sinc_interpolation import TAPS, resampled
from rift_cl.reconstruct.preprocess.zingers import remove_zingers

# Bins that a median goes across; every so many bins is bad; pixels of a neighbourhood.
_WINDOW, _EVERY, _PIXELS = 21, 3, 9
# Counts, and what exceeds their median by so much is a zinger.
_COUNTS, _EXCESS = 2000, 1000


@dataclass(frozen=True)
class StackCase:
    """Projections of some detector rows.

    Args:
        views: number of views.
        rows: detector rows.
        bins: bins of a row.
    """

    views: int
    rows: int
    bins: int
    itemsize = 4

    @property
    def name(self) -> str:
        """How tables call it."""
        return f"{self.views} × {self.rows} × {self.bins}"

    @property
    def size(self) -> int:
        """Pixels of all projections."""
        return self.views * self.rows * self.bins

    @property
    def bad(self) -> NDArray[np.bool_]:
        """Bins that are filled, (row, bin)."""
        mask = np.zeros((self.rows, self.bins), bool)
        mask[:, 1:-1:_EVERY] = True
        return mask

    @property
    def filled(self) -> float:
        """Pixels of all bad bins."""
        return float(self.views * np.count_nonzero(self.bad))

    def stack(self) -> Floats:
        """Counts with their noise, (view, row, bin)."""
        random = np.random.default_rng(0)
        return random.poisson(_COUNTS, (self.views, self.rows, self.bins)).astype(np.float32)

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        return {"name": self.name, "shape": [self.views, self.rows, self.bins]}


def _pixel(flops: float, arrays: int, formula: str) -> Cost:
    return Cost("pixel", flops, lambda c: c.size, lambda c: c.itemsize * arrays * c.size, formula)


CORRECTION_COSTS: dict[str, Cost] = {
    "stack_transpose": _pixel(
        0, 4, "no arithmetic; bytes: the stack in and out, once to columns and once back"
    ),
    "column_sort": _pixel(
        0, 3, "integers alone; bytes: values in, ranked values and their views out"
    ),
    "column_unsort": _pixel(0, 3, "no arithmetic; bytes: ranked values and views in, values out"),
    "column_median": _pixel(
        4 * _WINDOW,
        2,
        f"4 comparisons per pixel and bin of the window ({_WINDOW}): a value leaves the sorted "
        "window, another comes; bytes: columns in and out",
    ),
    "column_roughness": _pixel(
        13, 1, "13 flop per pixel: a mean of ten, distance, sum; bytes: columns in"
    ),
    "column_level": _pixel(1, 1, "1 flop per pixel; bytes: columns in"),
    "column_blend": Cost(
        "filled pixel",
        3,
        lambda c: c.filled,
        lambda c: 3 * c.itemsize * c.filled,
        "3 flop per filled pixel; bytes: two columns in, one out",
    ),
    "column_shift": _pixel(1, 2, "1 flop per pixel; bytes: columns in and out"),
    "local_median": _pixel(
        2 * _PIXELS**2,
        2,
        f"2 comparisons per pair of the neighbourhood's {_PIXELS} pixels; bytes: the stack in and "
        "out",
    ),
    "zinger_replace": _pixel(
        8, 3, "8 flop per pixel: excess, level, limit, test; bytes: stack and medians in, stack out"
    ),
    "resample_lines": Cost(
        "pixel",
        2 * (TAPS + 1),
        lambda c: c.size,
        lambda c: c.itemsize * (2 * c.size + (TAPS + 1) * c.rows * c.bins),
        f"{2 * (TAPS + 1)} flop per pixel: a multiply-add per tap; bytes: stack and weights in, "
        "stack out",
    ),
}


def correction_tasks(device: rift.Device, views: int, bins: int) -> Iterator[Task]:
    """Every kernel of its own, on eight rows."""
    case = StackCase(views, 8, bins)
    for name, run in _runs(device, case).items():
        yield Task(f"{name}, {case.name}", case, run, CORRECTION_COSTS)


def _runs(device: rift.Device, case: StackCase) -> dict[str, Callable[[], Any]]:
    stack, bad = case.stack(), case.bad
    columns = DetectorColumns(device, stack)
    shifts = np.linspace(-0.4, 0.6, case.rows)[:, None] + np.zeros(case.bins)
    levels = np.zeros(bad.shape)

    def ranked() -> None:
        columns.sort()
        columns.median(_WINDOW)
        columns.unsort()

    def profiles() -> None:
        columns.roughness()
        columns.levels(case.views // 10)

    def mended() -> None:
        columns.interpolate(bad)
        columns.subtract(levels)

    return {
        "columns and back": lambda: DetectorColumns(device, stack).projections(),
        "ranked median": ranked,
        "profiles": profiles,
        "fill and level": mended,
        "zingers": lambda: remove_zingers(stack, excess=_EXCESS, device=device),
        "shifts": lambda: resampled(device, stack, shifts, along="bins"),
    }
