"""The settings of ``rift fit photos``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional

from rift_cl.commands.fit.settings import USUAL_ORDER, FitSettings
from rift_cl.errors import InputError
from rift_cl.splat.settings import Activation, Angular, SplatSettings
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.settings import LearningRates, TrainSettings
from rift_cl.train.strategy import DefaultSettings, McmcSettings

# Photographs from which on the ramp is used: with 8 to 36 it never gained, with 64 short fits did.
ENOUGH_VIEWS = 40
# Learning rates of poses and exposures where they are refined.
_POSE_RATE, _EXPOSURE_RATE = 1e-3, 1e-2


@dataclass(frozen=True)
class FitPhotosSettings(FitSettings):
    """Fit splats to photographs.

    Example: rift fit photos capture/transforms.json --out fit --steps 3000 --splats 20000
    """

    job: ClassVar[str] = "fit photos"

    capture: Annotated[Path, Positional]
    """A transforms.json, a folder with one, a COLMAP model, a folder of photographs without poses,
    or a video (mp4, mov, webm)."""
    color_order: int | None = None
    """Highest order of the modes of each splat's colour, 0 to 8. Default: that of --order."""
    activation: Activation = "clamp"
    """How a splat's density E becomes its alpha: max(E, 0) (clamp), 1 - exp(-max(E, 0)) (exp), or
    1 - exp(-E) with the polynomial squared, so that E is never negative (square)."""
    angular: Angular = "sh"
    """Functions of the viewing direction for colours: spherical harmonics (sh), Hermite- or
    Laguerre-Gaussian lobes with an axis and a width (hg, lg), or isotropic or anisotropic spherical
    Gaussians (sg, asg)."""
    modes: int | None = None
    """Number of lobe modes or spherical Gaussians besides the constant, 1 to 35. Default: 8."""
    strategy: Literal["mcmc", "default"] = "mcmc"
    """How splats are added and moved: relocation with random walks (mcmc), or cloning, splitting
    and pruning as in the original 3D Gaussian splatting (default)."""
    absgrad: bool = False
    """With --strategy default: sum the magnitudes of gradients, which do not cancel (AbsGS)."""
    first_splats: float | None = None
    """Fraction of the splats that a fit without sparse points starts with. Default: 1 with mcmc,
    0.2 with the default strategy."""
    sh_degree: int = 3
    """Degree of the colours' spherical harmonics, 0 to 4."""
    homogenise: float | None = None
    """Exponent of the ramp that weighs the frequencies of the residual, so that fine detail counts
    as much as coarse (0 = none). Default: 0.5, but 0 for fewer than 40 photographs."""
    pinhole: bool = False
    """Treat every lens as a pinhole, sharp at every depth, whatever the capture says of its opening
    ('aperture_radius' and 'focus_distance' of a transforms.json)."""
    refine_poses: bool = False
    """Optimize the camera poses."""
    refine_exposures: bool = False
    """Fit a gain and an offset of each photograph's colours."""
    light: Literal["display", "linear"] = "display"
    """Light in which photographs are fitted and scored: as displays show it, or linear."""
    downscale: int | None = None
    """Whole factor by which photographs are downscaled. Default: the least that leaves none above
    1.6 megapixels, or 0.7 on a CPU."""
    frames: int = 100
    """Number of frames to take from a video: the sharpest, evenly spaced."""
    test: tuple[Path, ...] = ()
    """Further captures to score, never trained on."""

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer does; see ``FitSettings``."""
        super().check()
        if self.basis == "gaussian" and self.color_order is not None:
            raise InputError(
                f"--color-order is {self.color_order}, but Gaussian splats have no modes: add "
                "--basis hermite, or leave it out"
            )
        if self.modes is not None and self.angular == "sh":
            raise InputError(
                "--modes counts lobes: add --angular hg, lg, sg or asg, or give --sh-degree for "
                "harmonics"
            )
        if self.angular != "sh" and self.sh_degree != type(self).sh_degree:
            raise InputError(
                f"--sh-degree is about harmonics, which --angular {self.angular} replaces: give "
                "--modes, or leave it out"
            )
        self._check_least("downscale", 1)
        self._check_least("frames", 3)
        if not (self.first_splats is None or 0 < self.first_splats <= 1):
            raise InputError(f"--first-splats is {self.first_splats}, wanted above 0, at most 1")

    @property
    def exponent(self) -> float:
        """Of the ramp, as it was measured to serve: docs/homogenisation.md.

        Short fits of photographs gain by it, and long ones lose nothing.
        """
        return 0.5 if self.homogenise is None else self.homogenise

    def exponent_for(self, views: int) -> float:
        """The exponent for so many photographs; one that was given holds for any number."""
        asked = self.homogenise is not None or self.homogenise_by == "coverage"
        return self.exponent if asked or views >= ENOUGH_VIEWS else 0.0

    @property
    def first_count(self) -> int:
        """Splats that a fit without sparse points begins with."""
        usual = 1.0 if self.strategy == "mcmc" else 0.2
        share = usual if self.first_splats is None else self.first_splats
        return max(1, round(share * self.splats))

    def training(self) -> TrainSettings:
        """The trainer's settings."""
        return TrainSettings(
            steps=self.steps,
            seed=self.seed,
            splats=self.splats,
            strategy=(
                McmcSettings() if self.strategy == "mcmc" else DefaultSettings(absgrad=self.absgrad)
            ),
            sh_degree=self.sh_degree,
            homogenisation=Homogenisation(self.exponent, weight=self.homogenise_by),
            band_limit=self.band_limit,
            basis=self._basis(),
            angular=AngularSettings(self.angular, 8 if self.modes is None else self.modes),
            learning_rates=LearningRates(
                poses=_POSE_RATE if self.refine_poses else 0.0,
                exposures=_EXPOSURE_RATE if self.refine_exposures else 0.0,
            ),
        )

    def _basis(self) -> BasisSettings:
        if self.basis == "gaussian":
            return BasisSettings(activation=self.activation)
        order = USUAL_ORDER if self.order is None else self.order
        color = order if self.color_order is None else self.color_order
        return BasisSettings(self.basis, order, color, self.activation)

    def drawing(self) -> SplatSettings:
        """The rasterizer's settings."""
        return SplatSettings(eps2d=self.eps2d, absgrad=self.absgrad)
