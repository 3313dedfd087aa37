"""The notes that ImageJ leaves in a TIFF file's ImageDescription, and the tags beside them.

Lines of ``key=value`` after ``ImageJ=``: the unit, the distance of slices, how many there are, the
range of values to display, and for integers the calibration ``value = c0 + c1 * sample`` (``cf=0``
is ImageJ's number for a straight line). ImageJ reads the size of a pixel from XResolution and
YResolution as pixels per ``unit``, with ResolutionUnit "none". Other programs show the notes as
they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from rift_cl.io.volumes.layout import VolumeLayout

# ImageJ's own name for what it would write as an escaped micro sign otherwise.
_UNITS = {"micrometer": "micron"}
# TIFF keeps resolutions as fractions of 32-bit integers, which ImageJ takes for signed ones.
_LARGEST = (1 << 31) - 1
_FINEST, _COARSEST = 1e-9, 1e9


def description(
    layout: VolumeLayout, *, slices: int | None = None, display: tuple[float, float] | None = None
) -> str:
    """The notes for one slice, or for a stack of so many.

    Args:
        layout: the volume.
        slices: how many one file holds; None for a file of one slice.
        display: samples that are shown black and white; of fixed width, to be filled in later.
    """
    lines: dict[str, Any] = {"ImageJ": "1.54f"}
    if slices is not None:
        lines |= {"images": slices, "slices": slices, "loop": "false"}
    if layout.unit:
        lines["unit"] = _UNITS.get(layout.unit_name or "", _ascii(layout.unit))
    lines["spacing"] = repr(layout.spacing[0])
    for axis, origin, spacing in zip("zyx", layout.origin, layout.spacing, strict=True):
        if origin:
            lines[f"{axis}origin"] = repr(-origin / spacing)
    if layout.window is not None:
        lines |= {"cf": 0, "c0": repr(layout.window.low), "c1": repr(layout.window.step)}
        lines["vunit"] = _ascii(layout.value_unit or "attenuation")
    if display is not None:
        lines |= {"min": f"{display[0]:+.8e}", "max": f"{display[1]:+.8e}"}
    return "".join(f"{key}={value}\n" for key, value in lines.items())


def resolution(layout: VolumeLayout) -> dict[str, Any]:
    """Arguments of ``tifffile`` that give the size of a pixel."""
    _, high, wide = layout.spacing
    if not all(_FINEST < step < _COARSEST for step in (high, wide)):
        return {}
    return {"resolution": (_per(wide), _per(high)), "resolutionunit": "NONE"}


def _per(step: float) -> tuple[int, int]:
    """One over a length, as the nearest fraction that both parts of fit."""
    ratio = 1 / Fraction(step)
    most = min(_LARGEST, int(_LARGEST / ratio)) if ratio > 1 else _LARGEST
    near = ratio.limit_denominator(max(1, most))
    return near.numerator, near.denominator


def calibration(notes: Mapping[str, Any] | None) -> tuple[float, float]:
    """Step and offset of values over samples; 1 and 0 where the notes say nothing of them.

    Args:
        notes: as ``tifffile`` reads them.

    Raises:
        ValueError: they cannot be used.
    """
    notes = notes or {}
    if "c1" not in notes:
        return 1.0, 0.0
    step, offset = float(notes["c1"]), float(notes.get("c0", 0.0))
    if notes.get("cf") != 0 or not (math.isfinite(step) and math.isfinite(offset)):
        raise ValueError("its ImageJ calibration is not a straight line")
    return step, offset


def _ascii(text: str) -> str:
    """ImageJ's way to write what ASCII lacks."""
    line = " ".join(text.split())
    return "".join(c if c.isascii() else f"\\u{ord(c):04X}" for c in line)
