"""Linear operators on device arrays: projector, filters, and their algebra."""

from rift_cl.operators.linear import LinearOperator, dot_test
from rift_cl.operators.projector import Projector

