"""The settings of ``rift analyze``, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional

from rift_cl.commands.inputs.scan_input import ScanArrays
from rift_cl.commands.options import ResumableRun
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto

_MOST_ADDED = 64


@dataclass(frozen=True)
class AnalyzeInput(ScanArrays):
    """The capture or the scan, and how to read it."""

    group: ClassVar[str] = "input"

    source: Annotated[Path, Positional]
    """A capture (transforms.json, a folder with one, or a COLMAP model; its photographs need not
    be there), or a parallel-beam, fan-beam or cone-beam scan."""
    aperture: Auto[float] = None
    """Radius of the lens aperture in world units, for cameras whose file gives none. Default:
    pinholes."""
    focus: Auto[float] = None
    """With --aperture: distance in focus, in world units. Default: the target's centre."""
    wavelength: float = 550.0
    """Wavelength of the light in nanometres, where the file gives none; used with --unit."""
    unit: Auto[float] = None
    """Millimetres per world unit. Default: lengths stay in world units, without diffraction."""


@dataclass(frozen=True, kw_only=True)
class AnalyzeTarget:
    """What is analyzed."""

    group: ClassVar[str] = "target"

    mode: Auto[Literal["surface", "volume"]] = None
    """Whether the target is opaque (surface) or transparent as for X-rays (volume). Default:
    surface for captures, volume for scans."""
    center: Auto[tuple[float, float, float]] = None
    """Centre of the target in world coordinates. Default: where the cameras look."""
    diameter: Auto[float] = None
    """Diameter of the target in world units. Default: what the pictures or the detector show."""
    band: Auto[float] = None
    """Highest frequency of interest, in cycles per world unit. Default: 16 per diameter for
    captures, half a cycle per bin for scans."""
    add: int = 4
    """Number of views to suggest (0 = none)."""


@dataclass(frozen=True, kw_only=True)
class AnalyzeOutput:
    """What is written."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-analyze")
    """Folder for report.html, config.json and metrics.json, and of captures views.csv, the views to
    add, whose lengths are in millimetres with --unit and in world units without."""


@dataclass(frozen=True)
class AnalyzeSettings(ResumableRun, AnalyzeOutput, AnalyzeTarget, AnalyzeInput):
    """Analyze how views sample a target: coverage, resolution limits, and views to add.

    Example: rift analyze capture --out analysis --diameter 0.2 --unit 1000
    """

    def check(self) -> None:
        """Check every number's range.

        Raises:
            InputError: one is out of it, or options contradict each other.
        """
        for name in ("diameter", "aperture", "focus", "wavelength", "unit", "band"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise InputError(f"--{name} is {value:g}, wanted a positive number")
        if not 0 <= self.add <= _MOST_ADDED:
            raise InputError(f"--add is {self.add}, wanted 0 to {_MOST_ADDED} views")
        if self.center is not None and not all(map(math.isfinite, self.center)):
            raise InputError(f"--center is {self.center}, wanted finite coordinates")
        if self.focus is not None and self.aperture is None:
            raise InputError("--focus needs --aperture, the radius of the lens: give both")
