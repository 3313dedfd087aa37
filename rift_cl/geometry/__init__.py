"""Where things are: grids of samples and the scans that look at them. Values, no OpenCL."""

from rift_cl.geometry.grid import Grid
from rift_cl.geometry.scan import Parallel

__all__ = ["Grid", "Parallel"]
