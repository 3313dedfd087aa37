"""The settings of ``rift plan``, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import ClassVar, Literal

from rift_cl.commands.inputs.scan_input import ScanArrays
from rift_cl.commands.options import ResumableRun
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto, AutoExpert, Expert, Several

_MOST_VIEWS = 10_000


@dataclass(frozen=True, kw_only=True)
class PlanTarget:
    """What is to be seen, and what is known of it."""

    group: ClassVar[str] = "target"

    have: Auto[Path] = None
    """A capture, or a fan-beam or cone-beam scan, with views that are taken already: plan those
    that add most."""
    unit: float = 1.0
    """Millimetres per world unit of --have."""
    diameter: Auto[float] = None
    """Diameter of the target in millimetres. Default: that of --have, or 100."""
    center: Auto[tuple[float, float, float]] = None
    """Centre of the target in millimetres. Default: where the cameras of --have look, or 0 0 0.
    Not with a scan."""
    mode: Auto[Literal["surface", "volume"]] = None
    """Whether the target is opaque, a sphere standing for its surface (surface), or transparent as
    for X-rays, so that opposite views are equivalent (volume). Default: volume with --pilot
    or a scan as --have, otherwise surface."""
    pilot: Auto[Path] = None
    """A first reconstruction (a volume of 'rift reconstruct') as the prior of the target's power
    spectrum. Default: a power law 1/k^2."""
    pilot_spacing: AutoExpert[float] = None
    """Sample spacing of --pilot in millimetres. Default: such that the target fills the volume."""
    prior_trust: Expert[float] = 1.0
    """Fraction of the spectrum of --pilot that is trusted, 0 to 1; the rest is taken to be
    isotropic. 0.8 costs little where the pilot is right, and saves much where it is wrong."""
    prior_blur: Expert[float] = 0.0
    """Angular uncertainty of the spectrum of --pilot in degrees; it is blurred by as much."""
    snr: Expert[float] = 1000.0
    """Signal-to-noise ratio of one view at one cycle per diameter."""
    band: Auto[float] = None
    """Highest frequency of interest, in cycles per millimetre. Default: 16 per diameter."""


@dataclass(frozen=True, kw_only=True)
class PlanScan(ScanArrays):
    """How a scan as --have is read, where its file does not say it."""

    group: ClassVar[str] = "scan"

    def check_scan(self, have: Path | None) -> None:
        """Refuse options of a scan where there is none.

        Raises:
            InputError: one is given, and ``have`` is not there or is a capture.
        """
        given = next((f.name for f in fields(ScanArrays) if getattr(self, f.name) != f.default), "")
        if not given:
            return
        option = given.replace("_", "-")
        if have is None:
            raise InputError(f"--{option} applies to --have: name a scan")
        # Imported when asked, so that a command's help loads no reader.
        from rift_cl.io.captures.capture import holds_capture

        if have.exists() and holds_capture(have):
            raise InputError(f"--{option} applies to scans, --have {have} is a capture")


@dataclass(frozen=True, kw_only=True)
class PlanCameras:
    """The cameras, and where they may stand."""

    group: ClassVar[str] = "camera"

    camera: Several[Path] = ()
    """JSON files of cameras to choose from, such as {"name": "mine", "focal_length": 50,
    "f_number": 8, "pixel_um": 3.9, "size": [6000, 4000]}, or a list of them in "cameras". Default:
    a 24 megapixel camera with 50 mm at f/11."""
    lens: Auto[Path] = None
    """Lens prescription (.json or .zmx) for every camera. Default: the camera's own lens."""
    elevation: tuple[float, float] = (0.0, 75.0)
    """Lowest and highest elevation above the horizon in degrees; negative is from below. With
    a scan as --have: lowest and highest angle of the source out of the plane of its orbit (0 0
    stays in the plane; a fan always does)."""
    azimuth: tuple[float, float] = (-180.0, 180.0)
    """First and last azimuth around the target in degrees: 0 along x, 90 along y."""
    distance: Auto[tuple[float, float]] = None
    """Nearest and farthest distance from the target's centre in millimetres. Default: as near as
    the target fits into the picture; of a scanner, that of its source."""
    cover: Expert[float] = 1.0
    """Fraction of the target's outline that must lie in each picture, above 0, up to 1. For a
    scan as --have it is 0.05 at most."""
    path: Literal["free", "ring", "tilted-rings", "spline"] = "free"
    """Shape of the camera path: free positions, one ring, several tilted rings, or a smooth
    curve."""
    rings: int = 2
    """With --path tilted-rings: number of rings."""
    keep_out: Several[str] = ()
    """Regions without cameras: sphere:X,Y,Z,RADIUS, box:X,Y,Z,X,Y,Z (inf for unbounded), or
    cone:X,Y,Z,DX,DY,DZ,DEGREES, in millimetres; with the prefix 'body-' they also occlude the
    target, of whose outline cameras see --cover beside them. Default: none."""


@dataclass(frozen=True, kw_only=True)
class PlanMethod:
    """How the views are chosen."""

    group: ClassVar[str] = "method"

    views: int = 64
    """Number of views to plan; with --have, in addition to those."""
    criterion: Literal["wiener", "logdet", "worst"] = "wiener"
    """Criterion to minimize: posterior variance (wiener, A-optimal), negative information gain
    (logdet, D-optimal), or the variance in the worst direction (worst, E-optimal)."""
    budget: Auto[float] = None
    """Maximum total cost of the views; a view costs 1, or what its camera file says. Default: only
    their number is limited."""
    seed: int = 0
    """Random seed; the same seed gives the same plan."""


@dataclass(frozen=True, kw_only=True)
class PlanOutput:
    """What is written."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-plan")
    """Folder for transforms.json (lengths in the unit of the capture that --have names, so that its
    frames can be added to the capture's, and otherwise in millimetres), views.csv (in millimetres),
    report.html, config.json and metrics.json; for a cone-beam scan also vectors.txt, a line per
    view in ASTRA's order (source, detector centre, step between bins, step between rows), in
    millimetres."""


@dataclass(frozen=True)
class PlanSettings(ResumableRun, PlanOutput, PlanCameras, PlanScan, PlanTarget, PlanMethod):
    """Plan camera poses that minimize what remains uncertain about a target.

    Example: rift plan --views 64 --diameter 60 --elevation 0 70 --out plan
    """

    @property
    def opaque(self) -> bool:
        """Whether the target is planned for as a surface."""
        return self.pilot is None if self.mode is None else self.mode == "surface"

    def check(self) -> None:
        """Check every number's range.

        Raises:
            InputError: one is out of it, or options contradict each other.
        """
        if not 1 <= self.views <= _MOST_VIEWS:
            raise InputError(f"--views is {self.views}, wanted 1 to {_MOST_VIEWS}")
        for name in ("diameter", "unit", "budget", "snr", "band", "pilot_spacing"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                option = name.replace("_", "-")
                raise InputError(f"--{option} is {value:g}, wanted a positive number")
        if not 0 < self.cover <= 1:
            raise InputError(f"--cover is {self.cover:g}, wanted more than 0, up to 1")
        if self.center is not None and not all(map(math.isfinite, self.center)):
            raise InputError(f"--center is {self.center}, wanted finite coordinates")
        for name, least, most in (("elevation", -90, 90), ("azimuth", -720, 720),
                                  ("distance", 0, math.inf)):  # fmt: skip
            self._check_range(name, least, most)
        first, last = self.azimuth
        if last - first > 360:
            raise InputError(
                f"--azimuth is {first:g} {last:g}, more than the full circle of 360 degrees"
            )
        if self.path == "tilted-rings" and last - first < 360:
            raise InputError(
                f"--path tilted-rings needs the full circle, but --azimuth is {first:g} {last:g}: "
                "choose another path, or leave --azimuth out"
            )
        if self.seed < 0:
            raise InputError(f"--seed is {self.seed}, wanted 0 or more")
        if self.unit != 1 and self.have is None:
            raise InputError("--unit applies to --have: name a capture or a scan")
        self.check_scan(self.have)
        self._check_pilot()

    def _check_pilot(self) -> None:
        if not 0 <= self.prior_trust <= 1:
            raise InputError(f"--prior-trust is {self.prior_trust:g}, wanted 0 to 1")
        if not 0 <= self.prior_blur <= 90:
            raise InputError(f"--prior-blur is {self.prior_blur:g}, wanted 0 to 90 degrees")
        if self.pilot is None and (self.prior_trust != 1 or self.prior_blur != 0):
            raise InputError("--prior-trust and --prior-blur apply to --pilot: name a volume")
        if self.pilot_spacing is not None and self.pilot is None:
            raise InputError("--pilot-spacing applies to --pilot: name a volume")

    def _check_range(self, name: str, least: float, most: float) -> None:
        pair = getattr(self, name)
        if pair is None:
            return
        low, high = pair
        if not least <= low <= high <= most or not math.isfinite(high):
            limits = "two lengths" if most == math.inf else f"{least:g} to {most:g} degrees"
            raise InputError(
                f"--{name} is {low:g} {high:g}, wanted {limits}, the smaller number first"
            )
