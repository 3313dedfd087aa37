"""What ``rift analyze`` takes, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from rift_cl.errors import InputError
from rift_cl.io.scans.literals import AngleUnit

_MOST_ADDED = 64


@dataclass(frozen=True)
class AnalyzeSettings:
    """Analyze how views sample a target: coverage, resolution limits, and views to add.

    Example: rift analyze capture --out analysis --diameter 0.2 --unit 1000
    """

    source: Annotated[Path, Positional]
    """A capture (transforms.json, a folder with one, or a COLMAP model; its photographs need not
    be there), or a scan with parallel or fan-beam rays."""
    out: Path = Path("rift-analyze")
    """Folder for report.html, config.json, metrics.json and views.csv."""
    mode: Literal["surface", "volume"] | None = None
    """Whether the target is opaque, or seen through as by X-rays; photographs are taken to show
    surfaces, scans volumes, when not given."""
    center: tuple[float, float, float] | None = None
    """Middle of the target, in the capture's world; where its cameras look when not given."""
    diameter: float | None = None
    """Of the target; what the pictures or the detector show when not given."""
    aperture: float | None = None
    """Radius of the lens's opening, for cameras whose file says none, in units of the world."""
    focus: float | None = None
    """Distance of what is in focus, in units of the world; the target's middle when not given."""
    wavelength: float = 550.0
    """Of the light in nanometres, where the file says none; counts once --unit is known."""
    unit: float | None = None
    """Millimetres in a unit of the world; without it lengths are in units, and diffraction is left
    out."""
    band: float | None = None
    """Highest frequency that is wanted of the target, in cycles per unit of the world; 16 per
    diameter when not given."""
    add: int = 4
    """How many views to suggest; 0 for none."""
    dataset: str | None = None
    """Name of a scan's projections in its file; see 'rift reconstruct'."""
    theta: str | None = None
    """Name of a scan's angles, or a file of them, or a turn in degrees such as 0:180."""
    image_key: str | None = None
    """Name of the array that says what each frame of a scan is, as in NXtomo."""
    axes: str | None = None
    """Which axis of a scan's projections is which, such as angle,row,bin."""
    angle_unit: AngleUnit | None = None
    """Unit of a scan's angles."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
    overwrite: bool = False
    """Replace an earlier analysis in the same folder."""
    dry_run: bool = False
    """Say what would be done, and stop."""

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
            raise InputError("--focus is about --aperture: give its radius as well")
