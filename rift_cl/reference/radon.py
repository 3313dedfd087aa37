"""The X-ray transform with each of the footprints, exactly: what the phase tables approximate.

A pixel at (x, y) meets the detector at ``t = x cos(angle) + y sin(angle)``, that is at the bin
``t / pitch + center``. About it the pixel's mass dx dy is spread by its footprint
(``rift_cl/reference/footprint.py``), a density in 1 / bin, so that bin b receives

    dx dy / pitch * density(t / pitch + center - b).
"""

from __future__ import annotations

import math
from typing import Any

from scipy import sparse

from rift_cl.geometry import Grid, Parallel
from rift_cl.reference.footprint import footprint_matrix, footprint_of
from rift_cl.reference.matrix import MatrixProjector


def radon(grid: Grid, scan: Parallel, footprint: str = "strip") -> MatrixProjector:
    """The projector whose matrix is ``radon_matrix(grid, scan, footprint)``."""
    return MatrixProjector(radon_matrix(grid, scan, footprint), grid, scan)


def radon_matrix(grid: Grid, scan: Parallel, footprint: str = "strip") -> Any:
    """The matrix of the transform, sparse (angles * bins, ny * nx), in the unit of length.

    Args:
        grid: the image; of a volume, a slice.
        scan: how it is looked at.
        footprint: ``strip``, ``joseph`` or ``linear``.
    """
    plane = grid.slice()
    views = [_view(plane, scan, float(angle), footprint) for angle in scan.angles]
    return sparse.vstack(views, format="csr")


def _view(grid: Grid, scan: Parallel, angle: float, footprint: str) -> Any:
    cosine, sine = math.cos(angle), math.sin(angle)
    (dy, dx), pitch = grid.spacing, scan.pitch
    t = grid.coordinates(1) * cosine + grid.coordinates(0)[:, None] * sine
    spread = footprint_of(footprint, abs(dx * cosine) / pitch, abs(dy * sine) / pitch)
    densities = footprint_matrix(t.ravel() / pitch + scan.center, spread, scan.bins)
    return densities.T * (dx * dy / pitch)
