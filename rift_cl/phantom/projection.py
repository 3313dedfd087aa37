"""Exact line integrals of ellipsoids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Grid, Parallel
from rift_cl.phantom.ellipsoid import Ellipsoid, Reals


def project(ellipsoids: Sequence[Ellipsoid], grid: Grid, scan: Parallel) -> NDArray[np.float32]:
    """Exact line integrals of a sum of ellipsoids at the centres of the bins.

    In a direction at ``beta`` from the ellipse's own axes the chord at distance t from its middle
    is ``2 a b sqrt(w - t^2) / w`` with ``w = (a cos beta)^2 + (b sin beta)^2`` (Kak and Slaney,
    Principles of Computerized Tomographic Imaging, 1988, section 3.1).

    Args:
        ellipsoids: the parts, inside the grid or not; an image means their equatorial sections.
        grid: tells an image from a volume; the volume's slices are looked at in their middles.
        scan: the rays.

    Returns:
        Density times length, (angle, bin) for an image and (angle, row, bin) for a volume.
    """
    volume = len(grid.shape) == 3
    levels = list(grid.coordinates(0)[:, None]) if volume else [None]
    stack = np.empty((len(scan.angles), len(levels), scan.bins), dtype=np.float32)
    for k, z in enumerate(levels):
        stack[:, k] = _project_slice(ellipsoids, scan, z)
    return stack if volume else stack[:, 0]


def _project_slice(ellipsoids: Sequence[Ellipsoid], scan: Parallel, z: Reals | None) -> Reals:
    angles, t = scan.angles[:, None], scan.coordinates()
    total = np.zeros((len(angles), scan.bins))
    for part in ellipsoids:
        section = float(part.section(z)[0])
        if section > 0:
            (_, b, a), (_, y, x) = part.semi_axes, part.center
            beta = angles - part.angle
            width = (a * np.cos(beta)) ** 2 + (b * np.sin(beta)) ** 2
            offset = t - (x * np.cos(angles) + y * np.sin(angles))
            chord = np.sqrt(np.maximum(section * width - offset**2, 0)) / width
            total += 2 * a * b * part.value * chord
    return total
