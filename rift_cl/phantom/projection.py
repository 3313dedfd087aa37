"""Exact line integrals of ellipsoids, through rays side by side and through rays from a point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.geometry import Fan, Grid, Parallel, Scan
from rift_cl.phantom.ellipsoid import Ellipsoid, Reals
from rift_cl.phantom.rays import view_rays


def project(
    ellipsoids: Sequence[Ellipsoid], grid: Grid, scan: Scan, *, dtype: DTypeLike = np.float32
) -> NDArray[Any]:
    """Exact line integrals of a sum of ellipsoids at the centres of the bins.

    Side by side: in a direction at ``beta`` from the ellipse's own axes the chord at distance t
    from its middle is ``2 a b sqrt(w - t^2) / w`` with ``w = (a cos beta)^2 + (b sin beta)^2``
    (Kak and Slaney, Principles of Computerized Tomographic Imaging, 1988, section 3.1). From a
    point: in coordinates in which the ellipsoid is the unit ball, the line through o along d has
    the chord ``2 sqrt(|d|^2 - |d x o|^2) / |d|^2`` in units of d.

    Args:
        ellipsoids: the parts, inside the grid or not; an image means their equatorial sections.
        grid: tells an image from a volume; parallel and fan beams look at a volume's slices in
            their middles.
        scan: the rays, which are whole lines: no source stands inside an ellipsoid.
        dtype: of the result; it is computed in float64.

    Returns:
        Density times length: (angle, bin) for an image and (angle, row, bin) for a volume, with a
        row for each slice where the beam is parallel or a fan.
    """
    if not isinstance(scan, (Parallel, Fan)):
        views = np.empty((scan.views, scan.rows, scan.bins), dtype)
        for view in range(scan.views):
            source, rays = view_rays(scan, view)
            views[view] = sum((_chords(part, source, rays) for part in ellipsoids), np.zeros(1))
        return views
    volume = len(grid.shape) == 3
    levels = list(grid.coordinates(0)[:, None]) if volume else [None]
    stack = np.empty((len(scan.angles), len(levels), scan.bins), dtype)
    for k, z in enumerate(levels):
        if isinstance(scan, Parallel):
            stack[:, k] = _project_slice(ellipsoids, scan, z)
        else:
            stack[:, k] = _project_fan(ellipsoids, scan, z)
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


def _project_fan(ellipsoids: Sequence[Ellipsoid], scan: Fan, z: Reals | None) -> Reals:
    total = np.zeros((scan.views, scan.bins))
    sections = [float(part.section(z)[0]) for part in ellipsoids]
    for view in range(scan.views):
        source, rays = view_rays(scan, view)
        for part, section in zip(ellipsoids, sections, strict=True):
            if section > 0:
                # Rays in the equatorial plane see the section at z, which is smaller.
                source[2] = part.center[0]
                total[view] += _chords(part, source, rays, section)[0]
    return total


def _chords(part: Ellipsoid, source: Reals, rays: Reals, section: float = 1.0) -> Reals:
    """Value times length of an ellipsoid along rays, (rows, bins)."""
    start, ahead = _as_ball(part, source - np.array(part.center[::-1])), _as_ball(part, rays)
    square = (ahead**2).sum(-1)
    # As a cross product, which a source far away does not rob of its digits.
    beside = (np.cross(ahead, start) ** 2).sum(-1)
    inside = np.sqrt(np.maximum(section * square - beside, 0)) / square
    lengths: Reals = 2 * part.value * inside * np.sqrt((rays**2).sum(-1))
    return lengths


def _as_ball(part: Ellipsoid, vectors: Reals) -> Reals:
    """Vectors (x, y, z) in units in which the ellipsoid is the unit ball."""
    cosine, sine = math.cos(part.angle), math.sin(part.angle)
    c, b, a = part.semi_axes
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack([(cosine * x + sine * y) / a, (cosine * y - sine * x) / b, z / c], axis=-1)
