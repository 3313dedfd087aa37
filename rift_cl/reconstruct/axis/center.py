"""The search for the rotation axis of an array in memory, whatever the beam."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_host_array
from rift_cl.errors import ShapeError
from rift_cl.geometry import Cone, Fan, Parallel, Vectors
from rift_cl.reconstruct.axis.circular import axis_of_scan
from rift_cl.reconstruct.axis.estimate import AxisEstimate
from rift_cl.reconstruct.axis.search import axis_of_stack

Floats = NDArray[np.float64]


def find_center(
    sinogram: NDArray[np.float32],
    angles: Floats | Parallel | Fan | Cone,
    *,
    span: tuple[float, float] | None = None,
    device: Device | None = None,
) -> AxisEstimate:
    """Find the detector bin at which the rotation axis is seen.

    Views from opposite sides decide where there are enough of them (full turns, and those with the
    axis near an end of the detector), the double wedge for half turns, and the centres of mass for
    less, where nothing leaves the field of view. Fans, and the rows of a cone next to the source's
    orbit, are read as parallel views, and also tell the sense of rotation (``sense``).

    Args:
        sinogram: line integrals, (angle, bin) or (angle, row, bin); of a stack, at most five rows
            are looked at, evenly chosen, or among those that show the object where most show air;
            of a cone those near the row ``center[0]``, as they are or averaged in at most five
            groups.
        angles: directions in radians, in any order; or the scan, ``Parallel``, ``Fan`` or
            ``Cone``, whose centre (bin) and sense need not be right.
        span: where to search, in bins; for half turns the middle 60 % of the detector if not
            given, for full turns all of it but the outermost bins.
        device: accepted as by every method; the search runs on the host.

    Returns:
        The estimate; ``center`` is that of the middle row, and of a cone that of the orbit's row.

    Raises:
        InputError: the data do not tell the axis: no contrast, too few views, a wide gap between
            them, or nothing that stands out of the noise. Also: the span is not on the detector,
            or the scan is another one than a ``Parallel``, a ``Fan`` or a circular ``Cone``.
        ShapeError: the sinogram has not two or three axes, or not a view for each angle, or not
            the bins of the scan.
        NonFiniteError: a sample is not finite.
    """
    shape = np.shape(sinogram)
    if len(shape) not in (2, 3):
        raise ShapeError(
            f"find_center: sinogram has shape {shape}, wanted (angle, bin) or (angle, row, bin)"
        )
    if isinstance(angles, Fan | Cone | Vectors):
        return axis_of_scan(sinogram, angles, span)
    scan = angles if isinstance(angles, Parallel) else Parallel(angles, shape[-1])
    directions = scan.angles
    wanted = (directions.size, *shape[1:-1], scan.bins)
    y = as_host_array(sinogram, wanted, name="sinogram", wants="find_center")
    stack = y if y.ndim == 3 else y[:, None]

    def look(views: list[int], rows: list[int]) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = stack[np.ix_(views, rows)]
        return seen

    return axis_of_stack(lambda row: stack[:, row], look, stack.shape[1], directions, span)
