"""Linear operators on device arrays: projector, filters, and their algebra."""

from rift_cl.operators.adjoint_check import dot_test
from rift_cl.operators.filters import Filter, HighPass, Ramp, Response, ViewFilter, as_filter
from rift_cl.operators.linear import LinearOperator
from rift_cl.operators.projector import Projector

__all__ = [
    "Filter",
    "HighPass",
    "LinearOperator",
    "Projector",
    "Ramp",
    "Response",
    "ViewFilter",
    "as_filter",
    "dot_test",
]
