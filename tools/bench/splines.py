"""Backprojection by splines, as another package's interpolation asks for it.

The splines' factors are found on the host, which is the rest of the operation.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import rift_cl as rift
from bench.case import Case
from bench.costs import Cost
from bench.operations import Task
from bench.projections import pixels
from rift_cl.interop.spline_backprojection import backproject_spline

# Bins before and behind a view's own, and numbers that say where it lies.
_BESIDE, _LINE = 3, 3


def _bytes(case: Case) -> float:
    return 4 * (case.views * (case.bins + _BESIDE + _LINE) + pixels(case))


def _spline(flops: int) -> dict[str, Cost]:
    cost = Cost(
        "update",
        flops,
        lambda c: c.updates,
        _bytes,
        "per update 25 flop: place 2, cubic weights 15, sum 8; 4 for the nearest bin; bytes: the "
        "splines in, the image out",
    )
    return {"backproject_spline": cost}


SPLINE_COSTS = _spline(25)
_DEGREES = {"nearest bin": (0, _spline(4)), "cubic spline": (3, SPLINE_COSTS)}


def spline_tasks(device: rift.Device, n: int, views: int) -> Iterator[Task]:
    """Both degrees."""
    case = Case(n, views)
    A = case.projector(device)
    for name, (degree, costs) in _DEGREES.items():
        yield Task(name, case, partial(backproject_spline, A, case.sinogram, degree), costs)
