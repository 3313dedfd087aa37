"""The settings of ``rift center``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.options import ResumableRun
from rift_cl.option_marks import Auto


@dataclass(frozen=True, kw_only=True)
class CenterSearch:
    """Where the axis is searched, and what the report shows."""

    group: ClassVar[str] = "search"

    span: Auto[tuple[float, float]] = None
    """First and last detector bin of the search. Default: the middle 60 % of the detector for scans
    over 180 degrees, all of it for full turns."""
    row: Auto[int] = None
    """Detector row that the pictures show; the search uses several rows, whichever this is.
    Default: the middle row; of a cone beam that of the source's orbit."""
    out: Path = Path("rift-center")
    """Folder for report.html, with pictures and the score curve, config.json and metrics.json."""


@dataclass(frozen=True)
class CenterSettings(ResumableRun, CenterSearch, ScanInput):
    """Find the rotation axis of a scan.

    Of fan and cone beams it finds the sense of rotation as well.

    Example: rift center scan.h5 --out center
    """
