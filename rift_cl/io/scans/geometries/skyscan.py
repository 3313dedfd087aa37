"""Bruker's SkyScan ``.log``: the text beside the projections of a desktop scanner.

Lengths are millimetres and micrometres. The pitch is that of a pixel at the object times the
magnification, so that binning and the camera's taper are in it. The orbit plane is seen at the
optical axis, a line counted from the top; the axis at the middle column, which a scan with a camera
offset needs ``--center`` for. The file says nothing of the sense of rotation that two programs
would agree on: angles are taken to grow.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.scans.angle_list import AngleList
from rift_cl.io.scans.beam import Beam
from rift_cl.io.scans.geometries.ini_file import IniFile

# Pixels that are said twice differ by less than this share.
_SAME = 0.02


def read_skyscan(path: Path) -> Beam:
    """Source, detector and angles of a SkyScan scan.

    Raises:
        FileFormatError: a number that is needed is missing, or it is no such file.
    """
    file = IniFile.read(path)
    if not file.text("Object to Source (mm)"):
        raise FileFormatError(
            f"{path}: is no log of a SkyScan scan, it does not name 'Object to Source (mm)'"
        )
    rows, bins = file.whole("Number of Rows"), file.whole("Number of Columns")
    views, step = file.whole("Number of Files"), file.number("Rotation Step (deg)")
    to_axis, to_detector = (
        file.number("Object to Source (mm)"),
        file.number("Camera to Source (mm)"),
    )
    pixel = file.number("Image Pixel Size (um)") / 1000
    pitch = pixel * to_detector / to_axis if to_axis > 0 else pixel
    notes = [
        "The sense of rotation is not told in a way that programs agree on: if edges are double, "
        "turn it with --reversed."
    ]
    camera = file.number("Camera Pixel Size (um)", 0.0) / 1000 * _binning(file)
    if camera and abs(camera / pitch - 1) > _SAME:
        notes.append(
            f"A pixel of the camera is {camera:.4g} mm, and one of the image times the "
            f"magnification {pitch:.4g} mm: the latter is used."
        )
    line = file.number("Optical Axis (line)", (rows - 1) / 2)
    return Beam(
        source_to_axis=to_axis,
        source_to_detector=to_detector,
        pitch=(pitch, pitch),
        unit="mm",
        center=(line, (bins - 1) / 2),
        shape=(rows, bins),
        angles=AngleList(
            f"{path.name}, Rotation Step", step * np.arange(views, dtype=np.float64), unit="degrees"
        ),
        white=file.number("Reference Intensity", 0.0) or None,
        views=views,
        prefix=file.text("Filename Prefix"),
        notes=tuple(notes),
    )


def _binning(file: IniFile) -> float:
    word = file.text("Camera binning").lower().partition("x")[0]
    return float(word) if word.isdecimal() else 1.0
