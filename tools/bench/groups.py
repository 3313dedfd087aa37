"""What is measured besides whole reconstructions: filters, footprints, solvers, corrections.

A group is a table of its own. Its tasks are made when it has its turn, so that no two groups'
arrays are on the device together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple

import rift_cl as rift
from bench.case import Case
from bench.cones import CONE_COSTS, cone_tasks
from bench.corrections import CORRECTION_COSTS, correction_tasks
from bench.costs import Cost
from bench.coverages import COVERAGE_COSTS, coverage_tasks
from bench.fast_projections import FAST_COSTS, fast_tasks
from bench.modes import MODE_COSTS, mode_tasks
from bench.operations import Task
from bench.projections import COSTS, footprint_tasks
from bench.row_filters import filter_tasks
from bench.solver_steps import step_tasks
from bench.splines import SPLINE_COSTS, spline_tasks
from bench.vectors import VOLUME_COSTS, vector_tasks

# Every kernel's cost, or one of them where it depends on the task.
KNOWN: Mapping[str, Cost] = {
    **MODE_COSTS,
    **FAST_COSTS,
    **VOLUME_COSTS,
    **SPLINE_COSTS,
    **COVERAGE_COSTS,
    **CONE_COSTS,
    **CORRECTION_COSTS,
    **COSTS,
}


class Group(NamedTuple):
    """Tasks that stand in one table.

    Args:
        name: of the group, with its size.
        tasks: makes them.
    """

    name: str
    tasks: Callable[[], Iterable[Task]]


def groups(device: rift.Device, case: Case) -> list[Group]:
    """All groups at a size.

    Args:
        device: where to work.
        case: the image and the views; a volume has a quarter of its pixels along a side.
    """
    n, views, quarter = case.n, case.views, case.n // 4
    at = (device, n, views)
    return [
        Group("view filters", partial(filter_tasks, device, views, case.bins)),
        Group(f"footprints, {case.name}", partial(footprint_tasks, *at)),
        Group("vectors and total variation, an image", partial(vector_tasks, device, (n, n))),
        Group("the same, a volume", partial(vector_tasks, device, (quarter,) * 3)),
        Group(f"a step of conjugate gradients, {case.name}", partial(step_tasks, *at)),
        Group(f"splines, {case.name}", partial(spline_tasks, *at)),
        Group(f"the fast projector, {case.name}", partial(fast_tasks, *at)),
        Group("beams from a point", partial(cone_tasks, *at)),
        Group("corrections of projections", partial(correction_tasks, device, views, n)),
        Group("coverage", partial(coverage_tasks, device, views, quarter)),
        Group("splats with modes", partial(mode_tasks, device, 16 * n, n // 2)),
    ]
