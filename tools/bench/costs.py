"""What a kernel has to do: its work in units, operations and bytes.

Only necessary work counts, so that a kernel which does more of it (padding, hats that turn out to
be zero) shows a lower share of the device's limit. Bytes are the compulsory ones, every input
read once and every output written once; a share of the memory limit above one means that the
data stayed in a cache.

A kernel without a cost stops the benchmark: a new kernel needs its formula beside those of its
kind (projections.py, row_filters.py, vectors.py, splats.py and so on), and a task that launches it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple


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
    units: Callable[[Any], float]
    bytes: Callable[[Any], float]
    formula: str


def check_known(shipped: Iterable[str], known: Iterable[str]) -> None:
    """Every shipped kernel must have a cost among the known ones.

    Raises:
        CoverageError: some have none.
    """
    unknown = sorted(set(shipped) - set(known))
    if unknown:
        raise CoverageError(
            f"no cost is known for {', '.join(unknown)}: add its formula in tools/bench beside "
            "those of its kind, and a task that launches it"
        )


def check_measured(shipped: Iterable[str], measured: Iterable[str]) -> None:
    """Every shipped kernel must have been launched by some measurement.

    Raises:
        CoverageError: some were not.
    """
    forgotten = sorted(set(shipped) - set(measured))
    if forgotten:
        raise CoverageError(
            f"no measurement launched {', '.join(forgotten)}: add a task that does to the groups "
            "in tools/bench/groups.py"
        )
