"""The X-ray transform with the linear footprint, exactly: what the phase tables approximate.

A pixel at (x, y) meets the detector at ``t = x cos(angle) + y sin(angle)``. Its shadow is taken
for a hat about t, whose half-width is one bin, or the shadow's own width where that is more: the
larger of ``|dx cos|`` and ``|dy sin|``. A hat of half-width h bins has the area h pitch, and a
pixel the area dx dy, so that bin b receives

    dx dy / (h pitch) * max(0, 1 - |t / pitch + center - b| / h).
"""

from __future__ import annotations

import math
from typing import Any

from scipy import sparse

from rift_cl.geometry import Grid, Parallel
from rift_cl.reference.footprint import hat_matrix
from rift_cl.reference.matrix import MatrixProjector


def radon(grid: Grid, scan: Parallel) -> MatrixProjector:
    """The projector whose matrix is ``radon_matrix(grid, scan)``."""
    return MatrixProjector(radon_matrix(grid, scan), grid, scan)


def radon_matrix(grid: Grid, scan: Parallel) -> Any:
    """The matrix of the transform, sparse (angles * bins, ny * nx), in the unit of length."""
    plane = grid.slice()
    return sparse.vstack([_view(plane, scan, float(a)) for a in scan.angles], format="csr")


def _view(grid: Grid, scan: Parallel, angle: float) -> Any:
    cosine, sine = math.cos(angle), math.sin(angle)
    (dy, dx), pitch = grid.spacing, scan.pitch
    t = grid.coordinates(1) * cosine + grid.coordinates(0)[:, None] * sine
    half_width = max(1.0, abs(dx * cosine) / pitch, abs(dy * sine) / pitch)
    hats = hat_matrix(t.ravel() / pitch + scan.center, half_width, scan.bins)
    return hats.T * (dx * dy / (half_width * pitch))
