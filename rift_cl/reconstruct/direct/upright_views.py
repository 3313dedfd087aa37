"""Views of tilted detectors read as those of the upright detectors of a cone.

Filtered backprojection filters along rows that lie in the plane of the source's orbit. Where
detectors are tilted, rolled or shifted from view to view, and the source goes round a circle all
the same, each view is read at the places where the rays of an upright detector meet the tilted
one: a homography of rows and columns, and no change of values, which belong to rays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Vectors

Floats = NDArray[np.float64]

# A source may stand this share of its distance from the axis beside the circle.
_CIRCLE = 2e-3


def upright_cone(scan: Vectors) -> tuple[Cone, Floats]:
    """The cone whose detectors are upright in the place of those of a scan, and where they meet.

    Args:
        scan: places of source and detector; the source goes round the axis on a circle.

    Returns:
        The cone, and (views, 18) forms as ``kernels/include/cone/upright.h`` reads them: from the
        rows and columns of the cone's detectors to those of the scan's, and back.

    Raises:
        InputError: a source stands beside the circle; the sentence names the first such view.
    """
    radii = np.hypot(scan.source[:, 0], scan.source[:, 1])
    radius, height = float(np.median(radii)), float(np.median(scan.source[:, 2]))
    off = np.hypot(radii - radius, scan.source[:, 2] - height)
    if (off > _CIRCLE * radius).any():
        view = int(np.flatnonzero(off > _CIRCLE * radius)[0])
        raise InputError(
            f"Vectors: the source of view {view} stands {off[view]:.3g} beside the circle of the "
            f"others, {_CIRCLE * radius:.3g} is allowed"
        )
    angles = np.arctan2(scan.source[:, 0], -scan.source[:, 1])
    cosine, sine, zero = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    along = np.stack([cosine, sine, zero], axis=1)
    ahead = np.stack([-sine, cosine, zero], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    reach = scan.middle - scan.source
    pitch = tuple(float(np.median(np.linalg.norm(v, axis=1))) for v in (scan.down, scan.across))
    aside = float(np.median(reach[:, 2])), float(np.median((reach * along).sum(axis=1)))
    middle = (scan.rows - 1) / 2, (scan.bins - 1) / 2
    center = tuple(m - a / p for m, a, p in zip(middle, aside, pitch, strict=True))
    distance = float(np.median((reach * ahead).sum(axis=1)))
    heights = np.full(scan.views, height)
    cone = Cone(angles, scan.rows, scan.bins, pitch, radius, max(distance, radius), center, heights)
    # The ray to pixel (i, k) of an upright detector, counted from its middle, is linear in both.
    straight = cone.source_to_detector * ahead + aside[1] * along + aside[0] * up
    columns, rows = pitch[1] * along, np.broadcast_to(pitch[0] * up, along.shape)
    tilted = np.stack([scan.across, scan.down, reach], axis=2)
    there = np.linalg.solve(tilted, np.stack([straight, columns, rows], axis=2))
    # From (u, v, 1) to (1, k, i), with the divisor last in both.
    back = np.linalg.inv(there)[:, [1, 2, 0]][:, :, [2, 0, 1]]
    return cone, np.concatenate([there.reshape(-1, 9), back.reshape(-1, 9)], axis=1)
