"""What ``rift center`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rift_cl.commands.inputs.scan_input import ScanInput


@dataclass(frozen=True)
class CenterSettings(ScanInput):
    """Find the rotation axis of a parallel-beam scan.

    Example: rift center scan.h5 --out center
    """

    out: Path = Path("rift-center")
    """Folder for the pictures, the score curve and report.html."""
    row: int | None = None
    """Detector row that the pictures show; the middle one when not given. The axis is searched in
    several rows, whichever this is."""
    span: tuple[float, float] | None = None
    """First and last detector bin between which to search; when not given, the middle 60 % of the
    detector for half turns and all of it for full turns."""
