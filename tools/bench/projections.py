"""Projection and backprojection: what their kernels have to do, and the operations on a case."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Case
from bench.costs import Cost
from bench.operations import Task
from bench.row_filters import ROW_COSTS
from rift_cl.operators import FOOTPRINTS
from rift_cl.operators.projector.footprint import footprint_records
from rift_cl.operators.projector.parallel.phase_table import PHASES


def pixels(case: Case) -> float:
    """Pixels of all slices."""
    return case.slices * case.n**2


def samples(case: Case) -> float:
    """Bins of all views and slices."""
    return case.rows * case.bins


def entries(case: Case) -> float:
    """Entries of all phase tables: PHASES for each column that any image row reaches."""
    return case.slices * float(np.sum(_view_entries(case)))


def hats(case: Case) -> float:
    """Pairs of a table entry and a bin, or an edge between bins, within its footprint's reach."""
    cosine, sine = np.abs(np.cos(case.angles)), np.abs(np.sin(case.angles))
    step, cross_step = np.maximum(cosine, sine), np.minimum(cosine, sine)
    support = footprint_records(case.footprint, step, cross_step, 1.0).support
    return case.slices * float(np.sum(2 * support * _view_entries(case)))


def _view_entries(case: Case) -> Any:
    """Entries of each view's table of a slice, (views,).

    A view is walked along the axis that moves further over the detector, so a row starts
    ``slope <= 1`` columns after the one before (``kernels/include/tomo/phase_table.h``).
    """
    cosine, sine = np.abs(np.cos(case.angles)), np.abs(np.sin(case.angles))
    slope = np.minimum(cosine, sine) / np.maximum(cosine, sine)
    return PHASES * (case.n + slope * (case.n - 1))


def _table_and_planes(case: Case) -> float:
    return case.itemsize * (entries(case) + 2 * pixels(case))


def _table_and_sinogram(case: Case) -> float:
    return case.itemsize * (entries(case) + samples(case))


_UPDATE = (
    "4 flop per update (a pixel in a view): two table entries, a multiply-add each; "
    "bytes: the tables and the two planes"
)
_HAT = (
    "per hat (a table entry and a bin in its footprint's reach, two to an entry where that is one "
    "bin) 5 flop: distance, multiply-subtract, multiply-add; bytes: the tables and the sinogram"
)
_EDGE = (
    "per edge (a table entry and an edge between bins in reach of the pixel's shadow) 10 flop: "
    "distance, room within the shadow, its area by two multiply-adds and a difference, the rest of "
    "the whole, the step between bins or columns, multiply-add; bytes: the tables and the sinogram"
)
_BY_HATS = Cost("hat", 5, hats, _table_and_sinogram, _HAT)
_BY_EDGES = Cost("edge", 10, hats, _table_and_sinogram, _EDGE)

COSTS: dict[str, Cost] = {
    **ROW_COSTS,
    "radon_resample": _BY_HATS,
    "radon_resample_adjoint": _BY_HATS,
    "radon_resample_edges": _BY_EDGES,
    "radon_resample_edges_adjoint": _BY_EDGES,
    "axpby": Cost(
        "sample",
        1,
        pixels,
        lambda c: 2 * c.itemsize * pixels(c),
        "3 flop per sample; bytes: two arrays in, one out; where an array is only scaled, 1 flop, "
        "and the array in and out",
    ),
    "radon_backproject": Cost("update", 4, lambda c: c.updates, _table_and_planes, _UPDATE),
    "radon_project": Cost("update", 4, lambda c: c.updates, _table_and_planes, _UPDATE),
    "plane_split": Cost(
        "pixel",
        0,
        lambda c: 2 * pixels(c),
        lambda c: 4 * c.itemsize * pixels(c),
        "no arithmetic; bytes: each pixel read and written, once for each of the two planes",
    ),
    "plane_merge": Cost(
        "pixel",
        1,
        pixels,
        lambda c: 3 * c.itemsize * pixels(c),
        "1 flop per pixel; bytes: two planes read, the image written",
    ),
}


def projection_tasks(device: rift.Device, case: Case) -> list[Task]:
    """Both directions, and both reconstructions by integration, on device arrays."""
    A = case.projector(device)
    x, y = device.array(case.image, case.dtype), device.array(case.projections, case.dtype)
    runs = {
        "forward": lambda: A(x),
        "backward": lambda: A.T(y),
        "fbp": lambda: rift.fbp(A, y),
        "unfiltered": lambda: rift.backproject(A, y),
    }
    return [Task(name, case, run, COSTS) for name, run in runs.items()]


def footprint_tasks(device: rift.Device, n: int, views: int) -> Iterator[Task]:
    """Both directions with every footprint, and in float64 where the device has it."""
    cases = [Case(n, views, footprint=footprint) for footprint in FOOTPRINTS]
    if device.traits.fp64:
        cases.append(Case(n, views, dtype="float64"))
    for case in cases:
        kind = case.footprint if case.dtype == "float32" else f"{case.footprint}, {case.dtype}"
        for task in projection_tasks(device, case)[:2]:
            yield task._replace(operation=f"{task.operation}, {kind}")
