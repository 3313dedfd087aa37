"""RTK's ``geometry.xml``: nine numbers a view, see ``rift_cl.geometry.rtk_views``.

The file does not say how large a pixel is: that comes with the projections.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

from rift_cl.errors import FileFormatError, InputError
from rift_cl.geometry.rtk_views import RtkView, vectors_of_rtk
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.scans.beam import ViewVectors

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
        cameras = "; cameras of Metashape are read as the COLMAP model that it exports"
        raise FileFormatError(
            f"{path}: is no geometry of RTK's, its root is {root.tag[:40]!r}"
            f"{cameras if root.tag == 'document' else ''}"
        )
    if _number(path, root, "RadiusCylindricalDetector", 0.0):
        raise InputError(f"{path}: its detector is curved, vectors describe flat ones alone")
    if pitch is None:
        raise InputError(
            f"{path}: RTK's geometry does not say how large a pixel is, nor do the projections; "
            "--pitch only replaces a size that is known: "
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
    source, middle, across, down = vectors_of_rtk(views, pitch)
    return ViewVectors(source=source, middle=middle, across=across, down=down, unit=unit)


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
