"""Linear operators on device arrays: projector, filters, and their algebra."""

from rift_cl.operators.adjoint_check import dot_test
from rift_cl.operators.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.compensation_3d import central_planes, radial_lines
from rift_cl.operators.fast_projector import FastProjector
from rift_cl.operators.filters import Filter, HighPass, Ramp, Response, ViewFilter, as_filter
from rift_cl.operators.footprint import FOOTPRINTS
from rift_cl.operators.linear import LinearOperator
from rift_cl.operators.parallel_projector import ParallelProjector
from rift_cl.operators.projector import Projector
from rift_cl.operators.projector_choice import cheapest_projector

__all__ = [
    "COMPENSATIONS",
    "FOOTPRINTS",
    "Compensation",
    "FastProjector",
    "Filter",
    "HighPass",
    "LinearOperator",
    "ParallelProjector",
    "Projector",
    "Ramp",
    "Response",
    "ViewFilter",
    "as_filter",
    "central_planes",
    "cheapest_projector",
    "dot_test",
    "radial_lines",
]
