"""Settings of a fit: every switch of the trainer, in frozen values.

The settings of strategies stand beside their strategies, in ``rift_cl.train.strategy``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal, get_args

from rift_cl.errors import InputError
from rift_cl.splat.orders import count_of
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.loss.pixel_loss import PIXEL_LOSSES
from rift_cl.train.ranges import check_choice, check_number, check_whole
from rift_cl.train.strategy import DefaultSettings, McmcSettings, StrategySettings
from rift_cl.train.xray.solve_settings import SolveSettings

LossKind = Literal["l1", "l2"]
BandLimit = Literal["pixels", "coverage"]


@dataclass(frozen=True)
class LearningRates:
    """Adam's learning rates at the first step (3DGS, Kerbl et al. 2023); 0 = not trained.

    Raises:
        InputError: a number is out of its range.
    """

    means: float = 1.6e-4
    """Learning rate of positions, as a fraction of the scene's extent."""
    means_last: float = 0.01
    """Learning rate of positions at the cooldown, as a fraction of the first; it falls
    exponentially until then."""
    quats: float = 1e-3
    """Learning rate of quaternions."""
    log_scales: float = 5e-3
    """Learning rate of the logarithms of scales."""
    logits: float = 5e-2
    """Learning rate of the logits of opacities, or of the logarithms of X-ray densities."""
    sh: float = 2.5e-3
    """Learning rate of the constant colour (spherical harmonic of degree 0)."""
    sh_rest: float = 0.2
    """Learning rate of harmonics of degree 1 and above, as a fraction of ``sh``."""
    poses: float = 0.0
    """Learning rate of camera poses: of rotations in radians, of positions as a fraction of the
    scene's extent; it falls as that of the splats' positions does. 0 = poses are fixed."""
    exposures: float = 0.0
    """Learning rate of each image's gains and offsets; it falls likewise. 0 = there are none."""
    shape_modes: float = 2.5e-3
    """Learning rate of the Hermite modes of splats' shapes."""
    # At 1e-2 both serve short fits better, but fits of order 2 were lost after some 1,500 steps.
    color_modes: float = 2.5e-3
    """Learning rate of the Hermite modes of splats' colours."""
    lobes: float = 1e-2
    """Learning rate of the geometry of lobes: quaternions or axes, and logarithms of widths."""
    lobes_rest: float = 1.0
    """Learning rate of the coefficients of lobes, as a fraction of ``sh``."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        for item in fields(self):
            if item.name != "means_last":
                check_number(self, item.name)
        check_number(self, "means_last", most=1, above=True)


@dataclass(frozen=True)
class TrainSettings:
    """Settings of a fit.

    Raises:
        InputError: a number is out of its range.
    """

    steps: int = 3000
    """Number of optimization steps (one training image each)."""
    seed: int = 0
    """Random seed."""
    splats: int = 20_000
    """Largest number of splats."""
    sh_degree: int = 3
    """Highest degree of the spherical harmonics of colours, 0 to 4."""
    sh_every: int = 500
    """Steps after which the next degree of harmonics is added."""
    loss: LossKind = "l1"
    """Pixel loss: absolute (l1) or squared (l2) differences."""
    ssim_weight: float = 0.2
    """Fraction of 1 - SSIM in the loss; the rest is the pixel loss."""
    homogenisation: Homogenisation = field(default_factory=Homogenisation)
    """Weight of spatial frequencies in the gradient of the pixel loss."""
    noise: float | None = None
    """Standard deviation of the noise in the training images, in units of the image. Default:
    none."""
    band_limit: BandLimit | None = None
    """Keep splats no finer than the cameras resolve: half a pixel of the finest camera (pixels,
    Mip-Splatting), or what all views determine above noise (coverage). Default: no limit."""
    cooldown: float = 0.12
    """Fraction of the run, at its end, without random walks and penalties and with falling
    learning rates."""
    learning_rates: LearningRates = field(default_factory=LearningRates)
    """Adam's learning rates."""
    strategy: StrategySettings = field(default_factory=McmcSettings)
    """How splats are added, moved and removed."""
    basis: BasisSettings = field(default_factory=BasisSettings)
    """Hermite modes of the splats' shapes and colours, and how densities become opacities."""
    angular: AngularSettings = field(default_factory=AngularSettings)
    """Functions of the viewing direction that colours are made of; other kinds than ``sh`` take the
    place of all harmonics but the constant one."""
    solve: SolveSettings = field(default_factory=SolveSettings)
    """Periodic least-squares solve for densities and shape modes (X-rays only)."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        for name, least in (("steps", 1), ("splats", 1), ("sh_every", 1), ("seed", 0)):
            check_whole(self, name, least)
        check_whole(self, "sh_degree", 0, 4)
        for name in ("ssim_weight", "cooldown"):
            check_number(self, name, most=1)
        if self.noise is not None:
            check_number(self, "noise")
        check_choice(self, "loss", PIXEL_LOSSES.names)
        if self.band_limit is not None and self.band_limit not in get_args(BandLimit):
            wanted = "None, " + " or ".join(get_args(BandLimit))
            raise InputError(f"TrainSettings: band_limit is {self.band_limit!r}, wanted {wanted}")
        if not isinstance(self.strategy, StrategySettings):
            raise InputError(
                f"TrainSettings: strategy is {self.strategy!r}, wanted the settings of one, such "
                "as McmcSettings()"
            )
        absgrad = isinstance(self.strategy, DefaultSettings) and self.strategy.absgrad
        if absgrad and not self.basis.plain:
            raise InputError(
                "TrainSettings: strategy.absgrad wants magnitudes of screen gradients, which "
                "splats with modes or an activation do not have: leave it off"
            )

    @property
    def numbers(self) -> int:
        """Trained numbers of a splat at the end of the run."""
        basis, colors = self.basis, 3 * (self.sh_degree + 1) ** 2
        modes = count_of(basis.order) - 1 + 3 * (count_of(basis.color_order) - 1)
        return 11 + modes + (self.angular.numbers or colors)
