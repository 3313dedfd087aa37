"""What ``rift fit`` is asked for, and what of it the trainer and the rasterizer are told."""

from __future__ import annotations

import dataclasses
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional

from rift_cl.commands.fit_photos.basis_options import BasisOptions
from rift_cl.commands.fit_xray.options import XRAY_ONLY, XrayOptions
from rift_cl.errors import InputError
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.loss.homogenisation import Homogenisation, WeightKind
from rift_cl.train.settings import BandLimit, Densification, Rates, TrainSettings
from rift_cl.train.xray.solve_settings import SolveSettings
from rift_cl.train.xray.trainer import RIDGE, xray_settings

# Photographs from which on the ramp is used: with 8 to 36 it never gained, with 64 short fits did.
ENOUGH_VIEWS = 40
# Rates of poses and exposures where they are refined.
_POSE_RATE, _EXPOSURE_RATE = 1e-3, 1e-2
# Steps that no fit will ever take, and that every counter still holds.
_MOST_STEPS = 2**62
# What may differ between a run and the one that goes on with it: it changes no bit of the result.
_FREE = (
    *("out", "resume", "overwrite", "dry_run", "checkpoint_every", "view", "device", "config"),
    *("memory", "format"),
)


@dataclass(frozen=True)
class FitSettings(XrayOptions, BasisOptions):
    """Fit splats to posed photographs, or to the projections of an X-ray scan.

    Example: rift fit capture/transforms.json --out fit --steps 3000 --splats 20000
    """

    capture: Annotated[Path, Positional]
    """A transforms.json, a folder with one, a COLMAP model, a folder of bare photographs, or a
    video (mp4, mov, webm); with --mode xray a scan in an HDF5 or NPZ file."""
    out: Path = Path("rift-fit")
    """Folder for scene.ply, report.html, config.json, metrics.json and checkpoints; X-rays: for
    slices as well."""
    steps: int = 3000
    """Pictures that are looked at, one after the other."""
    splats: int = 20_000
    """Most splats."""
    seed: int = 0
    """Of everything that is random: the same seed gives the same splats, bit by bit."""
    strategy: Literal["mcmc", "default"] = "mcmc"
    """How splats find their places: renewal with random walks (mcmc), or cloning, splitting and
    pruning as 3D Gaussian splatting did at first (default)."""
    absgrad: bool = False
    """With the default strategy: go by magnitudes of gradients, which do not cancel (AbsGS)."""
    first_splats: float | None = None
    """Share of the splats that a fit without sparse points begins with; 1 with mcmc, 0.2 with
    the default strategy if not given."""
    sh_degree: int = 3
    """Degree of the colours' spherical harmonics, 0 to 4."""
    eps2d: float = 0.1
    """Variance that splats gain on the screen, in square pixels; 0.3 is usual and blurs small
    pictures, 0.05 to 0.1 suits cameras that all keep one distance."""
    homogenise: float | None = None
    """Exponent of the ramp that weighs the residual's frequencies, so that fine detail is pulled
    at as strongly as coarse; 0 for none. If not given 0.5, but 0 for fewer than 40 photographs, and
    for X-rays, where it is the frequencies along the detector's rows."""
    homogenise_by: WeightKind = "ramp"
    """What that exponent is of: the ramp, as for views that lie evenly, or one over how often all
    views together cover a frequency (coverage)."""
    band_limit: BandLimit | None = None
    """Let no splat be finer than what the cameras resolve: half a pixel of the finest camera
    (pixels, Mip-Splatting's 3D filter), or what all cameras know above noise (coverage)."""
    pinhole: bool = False
    """Take every lens for a pinhole, sharp at every depth, whatever the captures say of its
    opening ('aperture_radius' and 'focus_distance' of a transforms.json)."""
    refine_poses: bool = False
    """Fit the cameras' poses as well."""
    refine_exposures: bool = False
    """Fit a gain and an offset of each photograph's colours as well."""
    light: Literal["display", "linear"] = "display"
    """Light that is fitted and scored: as a display shows it, or linear."""
    downscale: int | None = None
    """Whole factor by which photographs are made smaller; when not given, the least that leaves
    none above 1.6 megapixels, or 0.7 on a processor."""
    frames: int = 100
    """Frames to take of a video: the sharpest, evenly spaced."""
    hold_out: int = 8
    """Every so many-th photograph is not trained on but scored; 0 for none."""
    views: int = 0
    """Train on so many photographs, evenly spaced; 0 for all."""
    test: tuple[Path, ...] = ()
    """More captures to score, never trained on."""
    checkpoint_every: int = 1000
    """Steps between two checkpoints, of which the last two are kept; 0 for none."""
    resume: bool = False
    """Go on from the last checkpoint in the same folder, to the same bits. With more --steps than
    before a fit, finished or not, is trained on: from there with the learning rates, densification
    and final phase that a fit of so many steps has, so that rates rise again before they fall."""
    config: Path | None = None
    """config.json of an earlier fit, whose settings, with every value that was decided there, are
    taken where nothing else is given."""
    view: bool = False
    """Show the fit in a browser while it runs, on this machine alone."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
    overwrite: bool = False
    """Replace an earlier fit in the same folder."""
    dry_run: bool = False
    """Take a few steps, say what would be done, the time and the memory, and stop."""

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer will.

        Raises:
            InputError: an option makes no sense, or not in this mode.
        """
        self.check_mode()
        self.check_basis()
        if self.angular != "sh" and self.sh_degree != type(self).sh_degree:
            raise InputError(
                f"--sh-degree is about harmonics, in whose place --angular {self.angular} puts "
                "lobes: say --modes, or leave it out"
            )
        least = {
            "downscale": 1,
            "frames": 3,
            "hold_out": 0,
            "views": 0,
            "checkpoint_every": 0,
            "solve": 0,
        }
        for name, bound in least.items():
            value = getattr(self, name)
            if value is not None and value < bound:
                option = name.replace("_", "-")
                raise InputError(f"--{option} is {value}, wanted {bound} or more")
        if self.solve > _MOST_STEPS:
            raise InputError(f"--solve is {self.solve}, wanted at most {_MOST_STEPS}")
        if not (self.first_splats is None or 0 < self.first_splats <= 1):
            raise InputError(f"--first-splats is {self.first_splats}, wanted above 0, at most 1")
        if self.homogenise_by == "coverage" and not self.exponent:
            raise InputError(
                "--homogenise-by coverage weighs nothing while the exponent is 0: add --homogenise "
                "0.5, say, or leave it out"
            )
        if self.resume and self.overwrite:
            raise InputError("--resume goes on with what --overwrite throws away: give one of them")

    @property
    def exponent(self) -> float:
        """Of the ramp, as it was measured to serve: docs/homogenisation.md.

        Short fits of photographs gain by it, and long ones lose nothing; those of X-rays gained
        nothing at length, and lost where there was noise.
        """
        if self.homogenise is not None:
            return self.homogenise
        return 0.5 if self.mode == "light" else 0.0

    def exponent_for(self, views: int) -> float:
        """The exponent for so many photographs; what was asked for holds for any number."""
        asked = self.homogenise is not None or self.homogenise_by == "coverage"
        return self.exponent if asked or views >= ENOUGH_VIEWS else 0.0

    def asks_for_noise(self, exponent: float) -> bool:
        """Whether the pictures' noise must be known, where this is the ramp's exponent."""
        return exponent > 0 or self.band_limit == "coverage"

    @property
    def first_count(self) -> int:
        """Splats that a fit without sparse points begins with."""
        usual = 1.0 if self.strategy == "mcmc" else 0.2
        share = usual if self.first_splats is None else self.first_splats
        return max(1, round(share * self.splats))

    def training(self) -> TrainSettings:
        """The trainer's part."""
        if self.mode == "xray":
            return xray_settings(
                steps=self.steps,
                seed=self.seed,
                splats=self.splats,
                exponent=self.exponent,
                weight=self.homogenise_by,
                band_limit=self.band_limit,
                basis=dataclasses.replace(self.basis_settings(colored=False), ridge=RIDGE),
                solve=SolveSettings(self.solve),
            )
        return TrainSettings(
            steps=self.steps,
            seed=self.seed,
            splats=self.splats,
            strategy=self.strategy,
            densification=Densification(absgrad=self.absgrad),
            sh_degree=self.sh_degree,
            homogenisation=Homogenisation(self.exponent, weight=self.homogenise_by),
            band_limit=self.band_limit,
            basis=self.basis_settings(),
            angular=self.angular_settings(),
            rates=Rates(
                poses=_POSE_RATE if self.refine_poses else 0.0,
                exposures=_EXPOSURE_RATE if self.refine_exposures else 0.0,
            ),
        )

    def drawing(self) -> SplatSettings:
        """The rasterizer's part."""
        return SplatSettings(eps2d=self.eps2d, absgrad=self.absgrad, mode=self.mode)

    def decisive(self) -> dict[str, Any]:
        """What decides the result, in words that JSON keeps: a resumed run must have the same."""
        values = {k: v for k, v in dataclasses.asdict(self).items() if k not in _FREE}
        # So that fits from before there was a choice still go on.
        if self.homogenise_by == "ramp":
            del values["homogenise_by"]
        if self.band_limit != "coverage":
            values["band_limit"] = self.band_limit == "pixels"
        later = (
            "pinhole",
            "solve",
            "frames",
            *(field.name for field in dataclasses.fields(BasisOptions)),
        )
        for name in later:
            if values[name] == getattr(type(self), name):
                del values[name]
        if self.mode == "light":
            # So that fits from before there were other modes still go on.
            values = {k: v for k, v in values.items() if k not in ("mode", *XRAY_ONLY)}
        else:
            values["rows"] = None if self.rows is None else list(self.rows)
        values["capture"] = str(self.capture.absolute())
        values["test"] = [str(path.absolute()) for path in self.test]
        return values

    def command(self) -> str:
        """The command line that goes on with this fit."""
        words = ["rift", "fit", str(self.capture)]
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("capture", "config", "overwrite", "resume") or value == field.default:
                continue
            words.append("--" + field.name.replace("_", "-"))
            if not isinstance(value, bool):
                words += [str(entry) for entry in (value if isinstance(value, tuple) else (value,))]
        return shlex.join([*words, "--resume"])
