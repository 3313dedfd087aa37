"""The Shepp-Logan head: the phantom that everybody compares by."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Grid, Scan
from rift_cl.phantom.ellipsoid import Ellipsoid
from rift_cl.phantom.projection import project
from rift_cl.phantom.rendering import render


def _upright(
    value: float, semi_axes_xyz: tuple[float, float, float], center_xyz: Sequence[float], deg: float
) -> Ellipsoid:
    # The published tables have y upwards. Here y grows with the index and index 0 is shown on top.
    (a, b, c), (x, y, z) = semi_axes_xyz, center_xyz
    return Ellipsoid((z, -y, x), (c, b, a), math.radians(-deg), value)


SHEPP_LOGAN: tuple[Ellipsoid, ...] = (
    _upright(1.0, (0.69, 0.92, 0.81), (0.0, 0.0, 0.0), 0),
    _upright(-0.8, (0.6624, 0.874, 0.78), (0.0, -0.0184, 0.0), 0),
    _upright(-0.2, (0.11, 0.31, 0.22), (0.22, 0.0, 0.0), -18),
    _upright(-0.2, (0.16, 0.41, 0.28), (-0.22, 0.0, 0.0), 18),
    _upright(0.1, (0.21, 0.25, 0.41), (0.0, 0.35, -0.15), 0),
    _upright(0.1, (0.046, 0.046, 0.05), (0.0, 0.1, 0.25), 0),
    _upright(0.1, (0.046, 0.046, 0.05), (0.0, -0.1, 0.25), 0),
    _upright(0.1, (0.046, 0.023, 0.05), (-0.08, -0.605, 0.0), 0),
    _upright(0.1, (0.023, 0.023, 0.02), (0.0, -0.606, 0.0), 0),
    _upright(0.1, (0.023, 0.046, 0.02), (0.06, -0.605, 0.0), 0),
)
"""The modified Shepp-Logan head inside the unit ball.

The ellipses are those of Shepp and Logan (IEEE Trans. Nucl. Sci. 21, 1974), with the contrasts of
Toft (The Radon Transform, PhD thesis, 1996), which make the details visible. Their extension into
z follows Kak and Slaney in the form of Schabel's ``phantom3d``; the rotations are the ellipses'.
"""


def shepp_logan(grid: Grid, *, oversampling: int = 4) -> NDArray[np.float32]:
    """The modified Shepp-Logan head, upright when row 0 is shown on top: 0 to 1, from ``render``.

    The head's unit ball has the radius ``min(ny * dy, nx * dx) / 2`` and stands about the grid's
    centre, not about the rotation axis: a grid away from the axis carries the head with it. The
    same radius holds along z, so that a volume of few slices is a slab through the middle.
    """
    density = render(head(grid), grid, oversampling=oversampling)
    # 1 - 0.8 - 0.2 is a hair below zero, which a later square root would not forgive.
    return np.maximum(density, 0, out=density)


def shepp_logan_sinogram(grid: Grid, scan: Scan) -> NDArray[np.float32]:
    """The exact line integrals of the head that ``shepp_logan(grid)`` shows; see ``project``.

    Along lines through the bins' centres: a detector averages over its bins, which several bins in
    place of each, averaged, come near to.
    """
    return project(head(grid), grid, scan)


def head(grid: Grid) -> tuple[Ellipsoid, ...]:
    """The head's ellipsoids where ``shepp_logan(grid)`` shows them."""
    plane = grid.slice()
    radius = min(n * d for n, d in zip(plane.shape, plane.spacing, strict=True)) / 2
    y, x = plane.center
    z = grid.center[0] if len(grid.shape) == 3 else 0.0
    return tuple(part.placed(radius, (z, y, x)) for part in SHEPP_LOGAN)
