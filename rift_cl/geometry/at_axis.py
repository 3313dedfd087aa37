"""A scan as filters along the detector see it: how far apart its bins are where the object is."""

from __future__ import annotations

import numpy as np

from rift_cl.geometry.cone import Cone
from rift_cl.geometry.fan import Fan
from rift_cl.geometry.scan import Parallel
from rift_cl.geometry.vectors import Vectors


def at_axis(scan: Parallel | Fan | Cone | Vectors) -> Parallel:
    """The parallel scan whose views and bins are those of a scan at the rotation axis.

    Args:
        scan: any. Of vectors the axis is the line x = y = 0, and their median counts.

    Returns:
        Its angles; its bins, as far apart as rays are at the axis; its centre.
    """
    if isinstance(scan, Parallel):
        return scan
    if isinstance(scan, Fan):
        return Parallel(scan.angles, scan.bins, scan.pitch / scan.magnification, scan.center)
    if isinstance(scan, Cone):
        pitch = scan.pitch[1] / scan.magnification
        return Parallel(scan.angles, scan.bins, pitch, scan.center[1])
    normal = np.cross(scan.across, scan.down)
    reach = ((scan.middle - scan.source) * normal).sum(axis=1)
    depth = -(scan.source * normal).sum(axis=1)
    pitch = np.linalg.norm(scan.across, axis=1) * np.abs(depth / reach)
    angles = np.arctan2(scan.across[:, 1], scan.across[:, 0])
    return Parallel(angles, scan.bins, float(np.median(pitch)))
