"""What ``rift plan`` takes, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rift_cl.errors import InputError

_MOST_VIEWS = 10_000


@dataclass(frozen=True)
class PlanSettings:
    """Plan camera poses that minimize what remains uncertain about a target.

    Example: rift plan --views 64 --diameter 60 --elevation 0 70 --out plan
    """

    views: int = 64
    """How many views to plan; with --have, how many more."""
    out: Path = Path("rift-plan")
    """Folder for transforms.json, views.csv, report.html, config.json and metrics.json."""
    diameter: float | None = None
    """Of the target in millimetres; 100, or that of --have, when not given."""
    center: tuple[float, float, float] | None = None
    """Middle of the target; 0 0 0, or where the cameras of --have look, when not given."""
    elevation: tuple[float, float] = (0.0, 75.0)
    """Lowest and highest above the horizon in degrees; below 0 is from beneath."""
    azimuth: tuple[float, float] = (-180.0, 180.0)
    """First and last direction round the target in degrees, 0 along x, 90 along y."""
    distance: tuple[float, float] | None = None
    """Nearest and farthest from the target's middle; as near as it fits into the picture when not
    given."""
    camera: tuple[Path, ...] = ()
    """JSON files of cameras to choose among, such as {"name": "mine", "focal_length": 50,
    "f_number": 8, "pixel_um": 3.9, "size": [6000, 4000]}, or a list of them in "cameras"; a 24
    megapixel camera with 50 mm at f/11 when not given."""
    lens: Path | None = None
    """Prescription (.json or .zmx) of the lens of every camera, instead of its own."""
    cover: float = 1.0
    """Share of the target's outline that must lie in each picture."""
    path: Literal["free", "ring", "tilted-rings", "spline"] = "free"
    """Where cameras may stand: anywhere, on one ring, on rings that lean, or on a smooth curve."""
    rings: int = 2
    """How many rings of --path tilted-rings there are."""
    keep_out: tuple[str, ...] = ()
    """Places without cameras: sphere:X,Y,Z,RADIUS, box:X,Y,Z,X,Y,Z (inf for endless),
    cone:X,Y,Z,DX,DY,DZ,DEGREES; with 'body-' before it the target is not seen through it either."""
    have: Path | None = None
    """A capture with views that are taken already: plan those that add most."""
    unit: float = 1.0
    """Millimetres in a unit of --have's world."""
    pilot: Path | None = None
    """A first reconstruction (a volume of 'rift reconstruct'): what the target's spectrum is like;
    one that falls as 1/k^2 when not given."""
    pilot_spacing: float | None = None
    """Millimetres between samples of --pilot; such that the target fills it when not given."""
    prior_trust: float = 1.0
    """Share of --pilot's spectrum that is believed, 0 to 1; the rest is taken to be the same in all
    directions. 0.8 costs little where the pilot is right, and saves much where it is wrong."""
    prior_blur: float = 0.0
    """Degrees by which directions of --pilot's spectrum may be wrong; it is blurred by as much."""
    merit: Literal["wiener", "logdet", "worst"] = "wiener"
    """What to make small: the unknown share of the target's power, minus the bits, or the unknown
    share in the worst direction."""
    mode: Literal["surface", "volume"] | None = None
    """Whether the target is opaque, so that a sphere's surface stands for it, or seen through as by
    X-rays, so that opposite views tell the same; opaque, but with --pilot, when not given."""
    budget: float | None = None
    """Most that all views may cost; a view costs 1, or what the camera's file says."""
    snr: float = 1000.0
    """Signal to noise of one view at one cycle per diameter."""
    band: float | None = None
    """Highest frequency that is wanted, in cycles per millimetre; 16 per diameter when not
    given."""
    seed: int = 0
    """Of the planner's chance; the same seed gives the same plan."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
    overwrite: bool = False
    """Replace an earlier plan in the same folder."""
    dry_run: bool = False
    """Say what would be done, and stop."""

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
                raise InputError(f"--{name} is {value:g}, wanted a positive number")
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
                f"--path tilted-rings goes all the way round, but --azimuth is {first:g} {last:g}: "
                "take another path, or the full circle"
            )
        if self.seed < 0:
            raise InputError(f"--seed is {self.seed}, wanted 0 or more")
        if self.unit != 1 and self.have is None:
            raise InputError("--unit is about the world of --have: name a capture")
        self._check_pilot()

    def _check_pilot(self) -> None:
        if not 0 <= self.prior_trust <= 1:
            raise InputError(f"--prior-trust is {self.prior_trust:g}, wanted 0 to 1")
        if not 0 <= self.prior_blur <= 90:
            raise InputError(f"--prior-blur is {self.prior_blur:g}, wanted 0 to 90 degrees")
        if self.pilot is None and (self.prior_trust != 1 or self.prior_blur != 0):
            raise InputError("--prior-trust and --prior-blur are about --pilot: name a volume")
        if self.pilot_spacing is not None and self.pilot is None:
            raise InputError("--pilot-spacing is about --pilot: name a volume")

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
