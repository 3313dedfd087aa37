"""Views of a point source as pinhole cameras: what counts, draws or fits with cameras, takes scans.

A detector's rows grow along z and a picture's rows grow downwards; together with bins that grow to
the right, as seen from the source, that is a mirrored picture. The camera's picture is therefore
the projection with its rows in reverse: ``picture[i] = projection[rows - 1 - i]``. Where the
vectors of a view are those of a picture already, its rows stay as they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.cone import Cone
from rift_cl.geometry.fan import Fan
from rift_cl.geometry.vectors import Vectors

# Cosine between rows and columns up to which they count as perpendicular.
_SQUARE = 1e-6


class ScanCameras(NamedTuple):
    """Cameras of a scan.

    Args:
        cameras: one for each view.
        reversed_rows: (views,) whether the camera's picture is the projection with its rows in
            reverse.
    """

    cameras: tuple[Camera, ...]
    reversed_rows: NDArray[np.bool_]


def scan_cameras(scan: Fan | Cone | Vectors) -> ScanCameras:
    """The pinhole cameras that see what the views of a scan see.

    Args:
        scan: a fan, whose pictures have one row, a cone, or vectors.

    Raises:
        InputError: the detector is curved, or a view's rows and columns are not perpendicular; the
            sentence names the first such view.
    """
    vectors = _vectors(scan)
    lengths = [np.linalg.norm(axis, axis=1) for axis in (vectors.across, vectors.down)]
    right, down = vectors.across / lengths[0][:, None], vectors.down / lengths[1][:, None]
    skewed = np.abs((right * down).sum(axis=1)) > _SQUARE
    if skewed.any():
        raise InputError(
            f"Vectors: across and down of view {int(np.flatnonzero(skewed)[0])} are not "
            "perpendicular, and a camera's pixels are rectangles"
        )
    reach = vectors.middle - vectors.source
    mirrored = (np.cross(right, down) * reach).sum(axis=1) < 0
    down = np.where(mirrored[:, None], -down, down)
    ahead = np.cross(right, down)
    distance = (reach * ahead).sum(axis=1)
    turns = np.stack([right, down, ahead], axis=1)
    cameras = []
    for view in range(vectors.views):
        # The source's foot on the detector, in pixels from the middle.
        foot = -turns[view, :2] @ reach[view] / [lengths[0][view], lengths[1][view]]
        principal = foot + np.array([vectors.bins, vectors.rows]) / 2
        focal = distance[view] / lengths[0][view], distance[view] / lengths[1][view]
        K = [[focal[0], 0, principal[0]], [0, focal[1], principal[1]], [0, 0, 1]]
        pose = np.eye(4)
        pose[:3, :3] = turns[view]
        pose[:3, 3] = -turns[view] @ vectors.source[view]
        cameras.append(Camera((vectors.rows, vectors.bins), K, pose))
    return ScanCameras(tuple(cameras), mirrored)


def _vectors(scan: Fan | Cone | Vectors) -> Vectors:
    if isinstance(scan, Vectors):
        return scan
    if scan.curved:
        raise InputError(
            f"{type(scan).__name__}: curved is True, and the picture of a pinhole camera is flat"
        )
    return (scan if isinstance(scan, Cone) else _one_row(scan)).vectors()


def _one_row(fan: Fan) -> Cone:
    distances = fan.source_to_axis, fan.source_to_detector
    return Cone(fan.angles, 1, fan.bins, fan.pitch, *distances, (0, fan.center))
