"""Slow, readable NumPy twins of the kernels, in float64.

They are the oracle of the tests and the documentation of the mathematics: each says in a few lines
what a kernel computes, from the definition and with numbers of its own. Nothing here knows a
device. Tests and tools alone import it: an import contract in pyproject.toml keeps it so.
"""

from rift_cl.reference.fan import fan, fan_matrix
from rift_cl.reference.filters import (
    filter_rows,
    ramp_taps,
    response_taps,
    shepp_logan_taps,
    weigh_rays,
)
from rift_cl.reference.matrix import MatrixProjector
from rift_cl.reference.phase_table import phase_table, phase_table_matrix
from rift_cl.reference.planes import merge, split
from rift_cl.reference.radon import radon, radon_matrix

__all__ = [
    "MatrixProjector",
    "fan",
    "fan_matrix",
    "filter_rows",
    "merge",
    "phase_table",
    "phase_table_matrix",
    "radon",
    "radon_matrix",
    "ramp_taps",
    "response_taps",
    "shepp_logan_taps",
    "split",
    "weigh_rays",
]
