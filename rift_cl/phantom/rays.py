"""The rays of scans from a point: one line from the source to the centre of every bin."""

from __future__ import annotations

import numpy as np

from rift_cl.geometry import Cone, Fan, Vectors
from rift_cl.phantom.ellipsoid import Reals


def view_rays(scan: Fan | Cone | Vectors, view: int) -> tuple[Reals, Reals]:
    """Source and rays of one view.

    Args:
        scan: the scan; the rays of a ``Fan`` lie in the plane z = 0 and are one row.
        view: which of its views.

    Returns:
        (3,) the source as (x, y, z), and (rows, bins, 3) the way from it to the bins' centres.
    """
    if isinstance(scan, Vectors):
        k = np.arange(scan.bins) - (scan.bins - 1) / 2
        i = np.arange(scan.rows) - (scan.rows - 1) / 2
        source = scan.source[view]
        bins = k[:, None] * scan.across[view] + i[:, None, None] * scan.down[view]
        return source, scan.middle[view] - source + bins
    cosine, sine = np.cos(scan.angles[view]), np.sin(scan.angles[view])
    gamma = scan.fan_angles()
    # On an arc every bin is as far from the source as the detector's middle is.
    reach = np.ones_like(gamma) if scan.curved else 1 / np.cos(gamma)
    reach = scan.source_to_detector * reach
    across, ahead = reach * np.sin(gamma), reach * np.cos(gamma)
    flat = across[:, None] * np.array([cosine, sine, 0]) + ahead[:, None] * [-sine, cosine, 0]
    height: float = 0.0
    rows: Reals = np.zeros(1)
    if isinstance(scan, Cone):
        height = scan.heights[view]
        rows = (np.arange(scan.rows, dtype=np.float64) - scan.center[0]) * scan.pitch[0]
    source = np.array([scan.source_to_axis * sine, -scan.source_to_axis * cosine, height])
    rays = np.broadcast_to(flat, (len(rows), *flat.shape)).copy()
    rays[..., 2] += rows[:, None]
    return source, rays
