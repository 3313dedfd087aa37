"""Linear operators on device arrays: projector, filters, and their algebra."""

from rift_cl.operators.adjoint_check import dot_test
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.compensation_3d import central_planes, radial_lines
from rift_cl.operators.filters.ramp_filters import (
    FILTERS,
    Filter,
    HighPass,
    Ramp,
    Response,
    ViewFilter,
    as_filter,
    register_filter,
)
from rift_cl.operators.host_operator import HostOperator
from rift_cl.operators.linear import LinearOperator
from rift_cl.operators.projector.cone.geometry_gradient import GeometryGradient, geometry_gradient
from rift_cl.operators.projector.footprint import FOOTPRINTS
from rift_cl.operators.projector.parallel.fast_projector import FastProjector
from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector
from rift_cl.operators.projector.parallel.projector_choice import cheapest_projector
from rift_cl.operators.projector.projector import Projector
from rift_cl.operators.stack import vstack

__all__ = [
    "COMPENSATIONS",
    "FILTERS",
    "FOOTPRINTS",
    "Compensation",
    "FastProjector",
    "Filter",
    "GeometryGradient",
    "HighPass",
    "HostOperator",
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
    "geometry_gradient",
    "radial_lines",
    "register_filter",
    "vstack",
]
