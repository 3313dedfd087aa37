"""Views as a person at a tripod wants them: angles, distances and what to set the lens to."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence

import numpy as np

from rift_cl.commands.inputs.view_set import Floats
from rift_cl.geometry import Camera
from rift_cl.report.plot.camera_plot import upright_frame

# {} stands for the unit of lengths; those of lenses are millimetres whatever the scene's are.
_COLUMNS = (
    "picture", "azimuth, degrees", "elevation, degrees", "distance, {}", "focus, {}", "camera",
    "focal length, mm", "f-number", "exposure", "x, {}", "y, {}", "z, {}",
)  # fmt: skip
_DIGITS = 6


def angles_of(camera: Camera, center: Floats, up: Floats) -> tuple[float, float, float]:
    """Azimuth and elevation in degrees, and distance, of a camera seen from the target's middle.

    Azimuth is 0 along the first horizontal axis (x where up is z), and 90 along the second.
    """
    way = upright_frame(up) @ (camera.center - center)
    azimuth = math.degrees(math.atan2(way[1], way[0]))
    distance = float(np.linalg.norm(way))
    return azimuth, math.degrees(math.asin(way[2] / distance)) if distance else 0.0, distance


def view_row(
    name: str,
    camera: Camera,
    center: Floats,
    up: Floats,
    lens: tuple[str, float | None, float | None, float | None] = ("", None, None, None),
) -> tuple[object, ...]:
    """One row of ``csv_text``.

    Args:
        name: of the picture.
        camera: the view.
        center: (3,) of the target.
        up: (3,) unit vector.
        lens: the camera's name, its focal length, f-number and exposure, as far as known.
    """
    focus = None if camera.aperture is None else camera.aperture.focus
    return (name, *angles_of(camera, center, up), focus, *lens, *camera.center.tolist())


def csv_text(rows: Sequence[Sequence[object]], units: str) -> str:
    """The rows under their headings; numbers with six digits that count, empty where unknown.

    Args:
        rows: as ``view_row`` makes them.
        units: of their lengths, such as "mm".
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(name.format(units) for name in _COLUMNS)
    for row in rows:
        writer.writerow(_cell(cell) for cell in row)
    return text.getvalue()


def _cell(value: object) -> object:
    if value is None:
        return ""
    # A coordinate that rounding left a little off zero is zero.
    return f"{round(value, 9) + 0.0:.{_DIGITS}g}" if isinstance(value, float) else value
