"""RTK's description of a view, nine numbers, as places of source and detector, and back.

Source: "3D Circular Projection Geometry" of the Reconstruction Toolkit. RTK turns about its y axis;
its point (x, y, z) is our (x, -z, y), so that ``ours.transpose(1, 0, 2)[::-1]`` is RTK's volume and
the gantry angle is ours in degrees. Detector coordinates are lengths, 0 at the image's origin,
which is taken to be in its middle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.vectors import Vectors

Floats = NDArray[np.float64]
# Cosine between rows and columns up to which they count as perpendicular.
_SQUARE = 1e-6


class RtkView(NamedTuple):
    """A view as RTK describes it; angles in degrees, lengths in one unit."""

    gantry: float
    out_of_plane: float
    in_plane: float
    to_axis: float
    to_detector: float
    source_x: float
    source_y: float
    detector_x: float
    detector_y: float


def vectors_of_rtk(views: Sequence[RtkView], pitch: tuple[float, float]) -> tuple[Floats, ...]:
    """Source, middle of the detector, steps across and down of every view, (view, 3) each.

    Args:
        views: the views.
        pitch: distance between rows and between bins.
    """
    frames = np.array([_frame(view) for view in views])
    source = np.array([(v.source_x, v.source_y, v.to_axis) for v in views])
    middle = np.array([(v.detector_x, v.detector_y, v.to_axis - v.to_detector) for v in views])
    across = np.broadcast_to([pitch[1], 0.0, 0.0], source.shape)
    down = np.broadcast_to([0.0, pitch[0], 0.0], source.shape)
    return tuple(_ours(frames, turned) for turned in (source, middle, across, down))


def rtk_of_vectors(scan: Vectors) -> tuple[list[RtkView], tuple[float, float]]:
    """The views of a scan as RTK describes them, and the distance of rows and of bins.

    Raises:
        InputError: rows and bins of a view are not perpendicular, or their pitch changes.
    """
    lengths = [np.linalg.norm(step, axis=1) for step in (scan.down, scan.across)]
    if max(np.ptp(length) / length.mean() for length in lengths) > _SQUARE:
        raise InputError("Vectors: the pitch changes from view to view, which RTK has no words for")
    across, down = scan.across / lengths[1][:, None], scan.down / lengths[0][:, None]
    if np.abs((across * down).sum(axis=1)).max() > _SQUARE:
        raise InputError("Vectors: rows and bins are not perpendicular, which RTK has no words for")
    views = []
    for view in range(scan.views):
        r, c = _rtks(across[view]), _rtks(down[view])
        frame = np.array([r, c, np.cross(r, c)])
        source, middle = frame @ _rtks(scan.source[view]), frame @ _rtks(scan.middle[view])
        views.append(
            RtkView(
                *_angles(frame),
                float(source[2]),
                float(source[2] - middle[2]),
                *(float(x) for x in (*source[:2], *middle[:2])),
            )
        )
    return views, (float(lengths[0].mean()), float(lengths[1].mean()))


def _ours(frames: Floats, turned: Floats) -> Floats:
    """Vectors of the rotated coordinates, (view, 3), in ours."""
    fixed: Floats = np.einsum("vji,vj->vi", frames, turned)
    ours: Floats = np.stack([fixed[:, 0], -fixed[:, 2], fixed[:, 1]], axis=1)
    return ours


def _rtks(point: Floats) -> Floats:
    return np.array([point[0], point[2], -point[1]])


def _frame(view: RtkView) -> Floats:
    """The matrix from RTK's fixed coordinates to the rotated ones."""
    z, x, y = (math.radians(-a) for a in (view.in_plane, view.out_of_plane, view.gantry))
    about_z = [[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]]
    about_x = [[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]]
    about_y = [[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]]
    frame: Floats = np.array(about_z) @ np.array(about_x) @ np.array(about_y)
    return frame


def _angles(frame: Floats) -> tuple[float, float, float]:
    """Gantry, out-of-plane and in-plane angle in degrees of ``_frame``'s matrix."""
    x = math.asin(max(-1.0, min(1.0, frame[2, 1])))
    y = math.atan2(-frame[2, 0], frame[2, 2])
    z = math.atan2(-frame[0, 1], frame[1, 1])
    gantry, out_of_plane, in_plane = (-math.degrees(angle) for angle in (y, x, z))
    return gantry % 360, out_of_plane, in_plane
