"""The projector by phase tables, from first principles.

Along an image row the ray coordinate t grows by equal steps, ``dx cos(angle)`` per column. So a
view's interpolant g, the sum of its bins' footprints, is first sampled at that step and at
``phases`` sub-steps,

    F[n] = g(origin + n step / phases),

and a pixel then reads g between the two samples about its own place, u columns from the origin:

    value = (1 - w) F[n] + w F[n + 1],      n + w = phases u.

With hats for footprints that is exact where g is straight between samples, and errs by
O(1 / phases) next to its kinks, which are one part in ``phases`` of all places: on white noise the
relative error falls by 2^-1.5 for twice the phases. The footprint of a strip has corners in its
slope only, where a pixel is seen aslant, and errs by O(1 / phases^2). All pixels of a row have the
same w, which is why the kernels do it.

The samples start at the first pixel of the row that comes earliest in the direction of the walk.
A view is walked along x where a step in x moves further over the detector than one in y, along y
otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from rift_cl.geometry import Grid, Parallel
from rift_cl.reference.footprint import footprint_matrix, footprint_of
from rift_cl.reference.matrix import MatrixProjector


def phase_table(
    grid: Grid, scan: Parallel, footprint: str = "strip", *, phases: int = 8
) -> MatrixProjector:
    """The projector whose matrix is ``phase_table_matrix(grid, scan, footprint)``."""
    return MatrixProjector(phase_table_matrix(grid, scan, footprint, phases=phases), grid, scan)


def phase_table_matrix(
    grid: Grid, scan: Parallel, footprint: str = "strip", *, phases: int = 8
) -> Any:
    """The matrix of the projector, sparse (angles * bins, ny * nx), in the unit of length.

    Args:
        grid: the image; of a volume, a slice.
        scan: how it is looked at.
        footprint: ``strip``, ``joseph`` or ``linear``.
        phases: samples of a view to each step from pixel to pixel.
    """
    plane = grid.slice()
    views = [_view(plane, scan, float(angle), footprint, phases) for angle in scan.angles]
    return sparse.vstack(views, format="csr")


def _view(grid: Grid, scan: Parallel, angle: float, footprint: str, phases: int) -> Any:
    (ny, nx), (dy, dx), pitch = grid.shape, grid.spacing, scan.pitch
    along_x, along_y = dx * math.cos(angle) / pitch, dy * math.sin(angle) / pitch
    y, x = grid.coordinates(0), grid.coordinates(1)
    corner = scan.center + (x[0] * math.cos(angle) + y[0] * math.sin(angle)) / pitch
    pixels = np.arange(ny * nx).reshape(ny, nx)
    step, between_rows = along_x, along_y
    if abs(along_x) < abs(along_y):
        step, between_rows, pixels = along_y, along_x, pixels.T
    starts = np.arange(len(pixels)) * (between_rows / step)
    earliest = int(np.argmin(starts))
    columns = (starts - starts[earliest])[:, None] + np.arange(pixels.shape[1])
    blend = _blend(phases * columns.ravel(), pixels.ravel())
    origin = corner + earliest * between_rows
    samples = origin + np.arange(blend.shape[1]) * (step / phases)
    spread = footprint_of(footprint, abs(along_x), abs(along_y))
    densities = footprint_matrix(samples, spread, scan.bins)
    return (blend @ densities).T * (dx * dy / pitch)


def _blend(places: NDArray[np.float64], pixels: NDArray[np.intp]) -> Any:
    """How pixels read the samples: sparse (pixels, samples), two weights for each pixel."""
    before = np.floor(places).astype(np.int64)
    weight = places - before
    values = np.concatenate([1 - weight, weight])
    samples = np.concatenate([before, before + 1])
    shape = (len(pixels), int(before.max()) + 2)
    return sparse.csr_matrix((values, (np.tile(pixels, 2), samples)), shape=shape)
