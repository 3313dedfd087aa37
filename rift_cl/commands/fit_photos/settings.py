"""The settings of ``rift fit photos``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from tyro.conf import Positional

from rift_cl.commands.fit.settings import FitOutput, FitSettings
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.commands.options import RepeatableRun
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto, AutoExpert, Expert, Several, Short, ShortSplats
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.basis_settings import BasisSettings
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.settings import TrainSettings
from rift_cl.train.strategy import DefaultSettings


@dataclass(frozen=True, kw_only=True)
class PhotosInput:
    """What is fitted, how it is read, and what of it is scored."""

    group: ClassVar[str] = "input"

    capture: Annotated[Path, Positional]
    """A transforms.json, a folder with one, a COLMAP model, a folder of photographs without poses,
    or a video (mp4, mov, webm)."""
    test: Several[Path] = ()
    """Further captures to score, never trained on. Default: none."""
    hold_out: Auto[int] = None
    """Hold out every Nth photograph for evaluation (0 = none). Default: those that the capture
    lists for it ('val_filenames' and 'test_filenames' of a transforms.json), or every 8th."""
    views: int = 0
    """Train on this many photographs, evenly spaced among those not held out (0 = all)."""
    downscale: Auto[int] = None
    """Whole factor by which photographs are downscaled. Default: the least that leaves none above
    1.6 megapixels, or 0.7 on a CPU."""
    light: Literal["display", "linear"] = "display"
    """Light in which photographs are fitted and scored: as displays show it, or linear."""
    pinhole: Expert[bool] = False
    """Treat every lens as a pinhole, sharp at every depth, whatever the capture says of its opening
    ('aperture_radius' and 'focus_distance' of a transforms.json)."""
    first_splats: AutoExpert[float] = None
    """Fraction of --splats that a fit without sparse points starts with. Default: 1, or 0.2 with
    --strategy default."""
    frames: int = 100
    """Number of frames to take from a video: the sharpest, evenly spaced."""


def _training() -> TrainSettings:
    """The trainer's defaults, with the choices left open that a fit makes."""
    return TrainSettings(
        basis=BasisSettings(order=None, color_order=None), homogenisation=Homogenisation(None)
    )


def _rendering() -> SplatSettings:
    """The rasterizer's defaults, but less blur; see the help of eps2d."""
    return SplatSettings(eps2d=0.1)


@dataclass(frozen=True, kw_only=True)
class PhotosTraining:
    """The optimization."""

    group: ClassVar[str] = "training"

    preset: Auto[Literal["lobes", "surface", "0.1"]] = None
    """Named set of values in place of the defaults; other options override them. Eight spherical
    Gaussians in place of the harmonics of each colour, which score higher and take longer (lobes),
    priors for depth and normals nearer to the surface (surface), or the defaults of version 0.1.0
    (0.1). Default: none."""
    training: Short[TrainSettings] = field(default_factory=_training)
    """The optimization."""
    rendering: ShortSplats[SplatSettings] = field(default_factory=_rendering)
    """The rasterizer."""


@dataclass(frozen=True, kw_only=True)
class FitPhotosSettings(RepeatableRun, FitOutput, PhotosTraining, PhotosInput, FitSettings):
    """Fit splats to photographs.

    '--strategy default --help' lists the options of that strategy.

    Example: rift fit photos capture/transforms.json --out fit --steps 3000 --splats 20000
    """

    job: ClassVar[str] = "fit photos"
    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer does; see ``FitSettings``."""
        super().check()
        angular, usual = self.training.angular, TrainSettings()
        if angular.kind == "sh" and angular.modes != usual.angular.modes:
            raise InputError(
                "--modes counts lobes: add --angular hg, lg, sg or asg, or give --sh-degree for "
                "harmonics"
            )
        if angular.kind != "sh" and self.training.sh_degree != usual.sh_degree:
            raise InputError(
                f"--sh-degree is about harmonics, which --angular {angular.kind} replaces: give "
                "--modes, or leave it out"
            )
        self._check_environment()
        self._check_surface()
        self._check_least("downscale", 1)
        self._check_least("frames", 3)
        if not (self.first_splats is None or 0 < self.first_splats <= 1):
            raise InputError(f"--first-splats is {self.first_splats}, wanted above 0, at most 1")

    def _check_environment(self) -> None:
        training, usual = self.training, TrainSettings()
        environment, given = training.environment, usual.environment
        if environment.shared:
            if training.sh_degree != usual.sh_degree:
                raise InputError(
                    "--sh-degree is replaced by --own-degree where --environment shared gives "
                    "splats a light in common: give that, or leave it out"
                )
            if training.angular.kind != "sh" and environment.own_degree != given.own_degree:
                raise InputError(
                    f"--own-degree is about harmonics, which --angular {training.angular.kind} "
                    "replaces: give --modes, or leave it out"
                )
        elif environment != given:
            raise InputError(
                "--environment-lobes and --own-degree are about a light that splats share: add "
                "--environment shared, or leave them out"
            )

    def _check_surface(self) -> None:
        surface = self.training.surface
        if surface.first != TrainSettings().surface.first and not surface.wanted:
            raise InputError(
                "--surface.first says when priors for surfaces begin, and there is none: add "
                "--surface.normal-consistency 0.03, say, or leave it out"
            )

    @property
    def first_share(self) -> float:
        """Fraction of the splats that a fit without sparse points begins with."""
        if self.first_splats is not None:
            return self.first_splats
        return 0.2 if isinstance(self.training.strategy, DefaultSettings) else 1.0

    @property
    def first_count(self) -> int:
        """Splats that a fit without sparse points begins with."""
        return max(1, round(self.first_share * self.training.splats))
