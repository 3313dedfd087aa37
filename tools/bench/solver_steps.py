"""A step of conjugate gradients, and what its vectors have to do.

Projector and filter do in a step what they do by themselves, once; vectors are counted here, as
images (``i``) and sinograms (``s``).
"""

from __future__ import annotations

from collections.abc import Iterator

import rift_cl as rift
from bench.case import Case
from bench.costs import Cost
from bench.operations import Task
from bench.projections import COSTS, pixels, samples
from bench.row_filters import ROW_COSTS
from bench.vectors import VECTOR_COSTS
from rift_cl.reconstruct import Cgls

# More steps than a benchmark ever does.
_STEPS = 1 << 30


def _step_costs(sums: int) -> dict[str, Cost]:
    """Costs of a step that adds up ``sums`` sinograms, besides image and direction."""
    return {
        **COSTS,
        **ROW_COSTS,
        "axpby": Cost(
            "sample",
            3,
            lambda c: 2 * pixels(c) + sums * samples(c),
            lambda c: 3 * c.itemsize * (2 * pixels(c) + sums * samples(c)),
            VECTOR_COSTS["axpby"].formula,
        ),
        # Of the gradient and of the residual with themselves, and of a step with its weighted one;
        # where residuals are weighted, of the residual with its weighted one, too.
        "dot_product": Cost(
            "sample",
            5,
            lambda c: pixels(c) + (1 + sums) * samples(c),
            lambda c: c.itemsize * (pixels(c) + (1 + 2 * sums) * samples(c)),
            VECTOR_COSTS["dot_product"].formula,
        ),
    }


def step_tasks(device: rift.Device, n: int, views: int) -> Iterator[Task]:
    """One step of CGLS, plain and with the ramp as its preconditioner."""
    case = Case(n, views)
    for name, precondition, sums in (("CGLS", None, 1), ("CGLS, ramp", "ramp", 2)):
        solver = Cgls(case.projector(device), case.projections, precondition=precondition)
        steps = solver.run(_STEPS)
        # The first step has its direction from the start.
        next(steps)
        yield Task(name, case, steps.__next__, _step_costs(sums))
