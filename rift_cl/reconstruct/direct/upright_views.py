"""Views of tilted detectors read as those of the upright detectors of a cone.

Filtered backprojection filters along rows that lie in the plane of the source's orbit. Where
detectors are tilted, rolled or shifted from view to view, and the source goes round a circle all
the same, each view is read at the places where the rays of an upright detector meet the tilted
one: a homography of rows and columns, and no change of values, which belong to rays.

Views that are read between their bins, and then once more by the backprojection, would be blurred
twice. Where they are, upright detectors therefore have twice as many bins, between which the second
reading loses hardly anything; the filter passes what the wider ones hold (``Finer``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Vectors

Floats = NDArray[np.float64]

# A source may stand this share of its distance from the axis beside the circle.
_CIRCLE = 2e-3
# Bins of an upright detector in the place of one.
FINER = 2
# So near to its middle, in bins, a bin is read as it is.
_MIDDLE = 0.01


def upright_cone(scan: Vectors) -> tuple[Cone, Floats]:
    """The cone whose detectors are upright in the place of those of a scan, and where they meet.

    Args:
        scan: places of source and detector; the source goes round the axis, x = y = 0, on a circle.

    Returns:
        The cone, with ``FINER`` times as many bins where views are read between theirs, and
        (views, 18) forms as ``kernels/include/cone/upright.h`` reads them: from the rows and
        columns of the cone's detectors to those of the scan's, and back.

    Raises:
        InputError: a source stands beside a circle about the axis; the sentence names the first
            such view.
    """
    radii = np.hypot(scan.source[:, 0], scan.source[:, 1])
    radius, height = float(np.median(radii)), float(np.median(scan.source[:, 2]))
    off = np.hypot(radii - radius, scan.source[:, 2] - height)
    if (off > _CIRCLE * radius).any():
        view = int(np.flatnonzero(off > _CIRCLE * radius)[0])
        raise InputError(
            f"Vectors: the source of view {view} stands {off[view]:.3g} beside the circle of "
            f"radius {radius:.4g} about the axis x = y = 0 at z = {height:.4g}, "
            f"{_CIRCLE * radius:.3g} is allowed: a circle about another axis is wanted in "
            "coordinates whose z is that axis"
        )
    angles = np.arctan2(scan.source[:, 0], -scan.source[:, 1])
    cone, there = _read_by(scan, angles, radius, height, 1)
    if not _at_middles(cone, there):
        cone, there = _read_by(scan, angles, radius, height, FINER)
    # From (u, v, 1) to (1, k, i), with the divisor last in both.
    back = np.linalg.inv(there)[:, [1, 2, 0]][:, :, [2, 0, 1]]
    return cone, np.concatenate([there.reshape(-1, 9), back.reshape(-1, 9)], axis=1)


def _read_by(
    scan: Vectors, angles: Floats, radius: float, height: float, finer: int
) -> tuple[Cone, Floats]:
    """Upright detectors of so many times as many bins, and their forms to those of the scan."""
    cosine, sine, zero = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    along = np.stack([cosine, sine, zero], axis=1)
    ahead = np.stack([-sine, cosine, zero], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    reach = scan.middle - scan.source
    distance = float(np.median((reach * ahead).sum(axis=1)))
    # A cone's detector is never before the axis: one that is, is seen from the source at the axis.
    far = max(distance, radius)
    grown = far / distance
    down, across = (
        grown * float(np.median(np.linalg.norm(v, axis=1))) for v in (scan.down, scan.across)
    )
    counts, pitch = (scan.rows, finer * scan.bins), (down, across / finer)
    aside = tuple(grown * float(np.median((reach * way).sum(axis=1))) for way in (up, along))
    center = tuple((n - 1) / 2 - a / p for n, a, p in zip(counts, aside, pitch, strict=True))
    heights = np.full(scan.views, height)
    cone = Cone(angles, *counts, pitch, radius, far, center, heights)
    # The ray to pixel (i, k) of an upright detector, counted from its middle, is linear in both.
    straight = cone.source_to_detector * ahead + aside[1] * along + aside[0] * up
    columns, rows = pitch[1] * along, np.broadcast_to(pitch[0] * up, along.shape)
    tilted = np.stack([scan.across, scan.down, reach], axis=2)
    return cone, np.linalg.solve(tilted, np.stack([straight, columns, rows], axis=2))


def _at_middles(cone: Cone, there: Floats) -> bool:
    """Whether all bins of upright detectors are bins of the scan's, in any order."""
    places = np.array([[0, 0], [0, 1], [1, 0], [1, 1], [0.5, 0.5]]).T
    k, i = (
        np.floor(place * (n - 1)) - (n - 1) / 2
        for place, n in zip(places, (cone.bins, cone.rows), strict=True)
    )
    u, _, depth = np.moveaxis(there @ np.stack([np.ones_like(k), k, i]), 1, 0)
    bins = u / depth + (cone.bins - 1) / 2
    return bool((np.abs(bins - np.round(bins)) < _MIDDLE).all())
