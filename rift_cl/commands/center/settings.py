"""The settings of ``rift center``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.options import ResumableRun
from rift_cl.option_marks import Auto, AutoExpert

if TYPE_CHECKING:
    from rift_cl.io.scans.scan_file import ScanFile


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
    row_pitch: AutoExpert[float] = None
    """Distance between detector rows, in the file's unit, or in bins where it has none; a tilt
    depends on it. Default: that of the file, or that between bins."""
    out: Path = Path("rift-center")
    """Folder for report.html, with pictures and the score curve, config.json and metrics.json."""


@dataclass(frozen=True)
class CenterSettings(ResumableRun, CenterSearch, ScanInput):
    """Find the rotation axis of a scan.

    Of fan and cone beams it finds the sense of rotation as well.

    Example: rift center scan.h5 --out center
    """

    def open_scan(self, *, fan: bool = False) -> ScanFile:
        """As of every command, with the distance between rows that is said."""
        from rift_cl.commands.inputs.scan_lengths import with_row_pitch

        scan = super().open_scan(fan=fan)
        return scan if self.row_pitch is None else with_row_pitch(scan, self.row_pitch)
