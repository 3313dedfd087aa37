"""Line integrals as a detector measures them: averaged over each of its bins."""

from __future__ import annotations

from dataclasses import replace

from rift_cl import phantom


def averaged_on(grid, parts, scan, factor=4):
    """Of ellipsoids in a cone, (views, rows, bins): means over factor x factor rays of a bin."""
    pitch = tuple(length / factor for length in scan.pitch)
    center = tuple((place + 0.5) * factor - 0.5 for place in scan.center)
    counts = {"rows": scan.rows * factor, "bins": scan.bins * factor}
    fine = phantom.project(parts, grid, replace(scan, pitch=pitch, center=center, **counts))
    return fine.reshape(scan.views, scan.rows, factor, scan.bins, factor).mean((2, 4))
