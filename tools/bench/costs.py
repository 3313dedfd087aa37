"""What each kernel has to do: its work in units, operations and bytes.

Only necessary work counts, so that a kernel which does more of it (padding, hats that turn out to
be zero) shows a lower share of the device's limit. Bytes are the compulsory ones, every input
read once and every output written once; a share of the memory limit above one means that the
data stayed in a cache.

A kernel that is not in ``COSTS`` stops the benchmark: a new kernel needs its formula here, and a
measurement that launches it in ``operations.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from bench.case import Case
from rift_cl.operators.phase_table import PHASES


class CoverageError(RuntimeError):
    """A kernel is shipped that the benchmark does not know or does not run."""


class Cost(NamedTuple):
    """The work of one kernel in one operation.

    Args:
        unit: what is counted.
        flops: floating-point operations per unit.
        units: how many there are in a case.
        bytes: compulsory bytes in a case.
        formula: the reasons for the three, for people.
    """

    unit: str
    flops: float
    units: Callable[[Case], float]
    bytes: Callable[[Case], float]
    formula: str


def pixels(case: Case) -> float:
    """Pixels of all slices."""
    return case.slices * case.n**2


def samples(case: Case) -> float:
    """Bins of all views and slices."""
    return case.slices * case.views * case.bins


def entries(case: Case) -> float:
    """Entries of all phase tables: PHASES for each column that any image row reaches.

    A view is walked along the axis that moves further over the detector, so a row starts
    ``slope <= 1`` columns after the one before (``kernels/include/phase_table.h``).
    """
    cosine, sine = np.abs(np.cos(case.angles)), np.abs(np.sin(case.angles))
    slope = np.minimum(cosine, sine) / np.maximum(cosine, sine)
    return case.slices * PHASES * float(np.sum(case.n + slope * (case.n - 1)))


def _table_and_planes(case: Case) -> float:
    return 4 * (entries(case) + 2 * pixels(case))


def _table_and_sinogram(case: Case) -> float:
    return 4 * (entries(case) + samples(case))


def _hats(case: Case) -> float:
    return 2 * entries(case)


_UPDATE = (
    "4 flop per update (a pixel in a view): two table entries, a multiply-add each; "
    "bytes: the tables and the two planes"
)
_HAT = (
    "5 flop per hat (a table entry and a bin within one bin of it, two to an entry): distance, "
    "multiply-subtract, multiply-add; bytes: the tables and the sinogram"
)

COSTS: dict[str, Cost] = {
    "axpby": Cost(
        "sample",
        3,
        pixels,
        lambda c: 12 * pixels(c),
        "3 flop per sample (the unfiltered image is scaled); bytes: two arrays in, one out",
    ),
    "radon_backproject": Cost("update", 4, lambda c: c.updates, _table_and_planes, _UPDATE),
    "radon_project": Cost("update", 4, lambda c: c.updates, _table_and_planes, _UPDATE),
    "radon_resample": Cost("hat", 5, _hats, _table_and_sinogram, _HAT),
    "radon_resample_adjoint": Cost("hat", 5, _hats, _table_and_sinogram, _HAT),
    "filter_views": Cost(
        "MAC",
        2,
        lambda c: samples(c) * c.bins,
        lambda c: 8 * samples(c),
        "2 flop per MAC, bins² of them to a detector row; bytes: the sinogram in and out",
    ),
    "plane_split": Cost(
        "pixel",
        0,
        lambda c: 2 * pixels(c),
        lambda c: 16 * pixels(c),
        "no arithmetic; bytes: each pixel read and written, once for each of the two planes",
    ),
    "plane_merge": Cost(
        "pixel",
        1,
        pixels,
        lambda c: 12 * pixels(c),
        "1 flop per pixel; bytes: two planes read, the image written",
    ),
}


def check_known(shipped: Iterable[str], known: Iterable[str]) -> None:
    """Every shipped kernel must have a cost among the known ones.

    Raises:
        CoverageError: some have none.
    """
    unknown = sorted(set(shipped) - set(known))
    if unknown:
        raise CoverageError(
            f"no cost is known for {', '.join(unknown)}: add its formula to tools/bench/costs.py "
            "and an operation that launches it to tools/bench/operations.py"
        )


def check_measured(shipped: Iterable[str], measured: Iterable[str]) -> None:
    """Every shipped kernel must have been launched by some measurement.

    Raises:
        CoverageError: some were not.
    """
    forgotten = sorted(set(shipped) - set(measured))
    if forgotten:
        raise CoverageError(
            f"no measurement launched {', '.join(forgotten)}: add an operation that does to "
            "tools/bench/operations.py"
        )
