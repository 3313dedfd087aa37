"""RTK's ``geometry.xml``: nine numbers a view, in the coordinates of a radiotherapy gantry.

Source: RTK's "3D Circular Projection Geometry". RTK's axis of rotation is y; a point (x, y, z) of
RTK's is our (x, -z, y), so that ``ours.transpose(1, 0, 2)[::-1]`` is RTK's volume and the gantry
angle is ours in degrees. The file does not say how large a pixel is: it comes with the projections,
whose middle is taken to be the origin of the detector.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.scans.beam import Floats, ViewVectors

_LARGEST = 64 << 20
_NAMES = (
    "GantryAngle",
    "OutOfPlaneAngle",
    "InPlaneAngle",
    "SourceToIsocenterDistance",
    "SourceToDetectorDistance",
    "SourceOffsetX",
    "SourceOffsetY",
    "ProjectionOffsetX",
    "ProjectionOffsetY",
)


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


def read_rtk(path: Path, pitch: tuple[float, float] | None, unit: str = "") -> ViewVectors:
    """Source and detector of every view.

    Args:
        path: the file.
        pitch: distance between rows and between bins, as the projections tell; None if unknown.
        unit: of length.

    Raises:
        FileFormatError: it is no such file.
        InputError: the pitch is not known, or the detector is curved, or the rays parallel.
    """
    with reading(path, "RTK's geometry"):
        check_claim(path, "RTK's geometry", path.stat().st_size, _LARGEST)
        text = path.read_text(encoding="utf-8-sig")
        if "<!ENTITY" in text:
            raise FileFormatError(f"{path}: defines entities, which no geometry of RTK's needs")
        root = ElementTree.fromstring(text)
    if not root.tag.startswith("RTKThreeDCircularGeometry"):
        raise FileFormatError(f"{path}: is no geometry of RTK's, its root is {root.tag[:40]!r}")
    if _number(path, root, "RadiusCylindricalDetector", 0.0):
        raise InputError(f"{path}: its detector is curved, vectors describe flat ones alone")
    if pitch is None:
        raise InputError(
            f"{path}: RTK's geometry does not say how large a pixel is, nor do the projections: "
            "write a file of ours with 'geometry: geometry.xml' and 'pitch: [ROW, BIN]', and give "
            "it with geometry= (--geometry)"
        )
    common = [_number(path, root, name, 0.0) for name in _NAMES]
    views = [
        RtkView(*(_number(path, view, n, c) for n, c in zip(_NAMES, common, strict=True)))
        for view in root.iter("Projection")
    ]
    if not views:
        raise FileFormatError(f"{path}: names no projection")
    if any(view.to_detector == 0 for view in views):
        raise InputError(f"{path}: its rays are parallel; give their angles with theta= (--theta)")
    return rtk_vectors(views, pitch, unit)


def rtk_vectors(views: list[RtkView], pitch: tuple[float, float], unit: str = "") -> ViewVectors:
    """RTK's numbers as vectors in our coordinates.

    Args:
        views: the views.
        pitch: distance between rows and between bins.
        unit: of length.
    """
    frames = np.array([_frame(view) for view in views])
    source = np.array([(v.source_x, v.source_y, v.to_axis) for v in views])
    middle = np.array([(v.detector_x, v.detector_y, v.to_axis - v.to_detector) for v in views])
    return ViewVectors(
        source=_ours(frames, source),
        middle=_ours(frames, middle),
        across=_ours(frames, np.broadcast_to([pitch[1], 0.0, 0.0], source.shape)),
        down=_ours(frames, np.broadcast_to([0.0, pitch[0], 0.0], source.shape)),
        unit=unit,
    )


def _ours(frames: Floats, turned: Floats) -> Floats:
    """Vectors of the rotated coordinates, (view, 3), in ours."""
    fixed: Floats = np.einsum("vji,vj->vi", frames, turned)
    ours: Floats = np.stack([fixed[:, 0], -fixed[:, 2], fixed[:, 1]], axis=1)
    return ours


def _frame(view: RtkView) -> Floats:
    """The matrix from RTK's fixed coordinates to the rotated ones."""
    z, x, y = (math.radians(-a) for a in (view.in_plane, view.out_of_plane, view.gantry))
    about_z = [[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]]
    about_x = [[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]]
    about_y = [[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]]
    frame: Floats = np.array(about_z) @ np.array(about_x) @ np.array(about_y)
    return frame


def _number(path: Path, node: ElementTree.Element, name: str, default: float) -> float:
    text = node.findtext(name)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileFormatError(f"{path}: {name} is {text.strip()[:40]!r}, wanted a number")
    return value
