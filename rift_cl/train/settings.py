"""Settings of a fit: every switch of the trainer, in frozen values.

The settings of strategies stand beside their strategies, in ``rift_cl.train.strategy``. Fits of
X-rays have defaults of their own (``rift_cl.train.xray.settings``), and so have those of
photographs (``rift_cl.commands.fit_photos.settings``).
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Literal, TypeVar, get_args

from rift_cl.errors import SettingError
from rift_cl.option_marks import Expert, NoOption, Short, ShortAuto, ShortExpert, ShortSplats
from rift_cl.splat.orders import count_of
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.environment_settings import EnvironmentSettings
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.loss.pixel_loss import PIXEL_LOSSES
from rift_cl.train.octave_settings import OctaveSettings
from rift_cl.train.ranges import check_number, check_registered, check_whole
from rift_cl.train.strategy import STRATEGIES, DefaultSettings, ResidualSettings, StrategySettings
from rift_cl.train.surface_settings import SurfaceSettings
from rift_cl.train.xray.solve_settings import SolveSettings

BandLimit = Literal["pixels", "coverage"]


T = TypeVar("T", bound="TrainSettings")
_STRATEGY_HELP = (
    "How splats are added, moved and removed: splats that contribute little are moved to where the "
    "residual is largest (residual), transparent ones are relocated, with random walks if wanted "
    "(mcmc), or splats are cloned, split and pruned as in the original 3D Gaussian splatting "
    "(default). Each has options of its own, which --help lists with it."
)


@dataclass(frozen=True)
class LearningRates:
    """Adam's learning rates at the first step (3DGS, Kerbl et al. 2023); 0 = not trained.

    Raises:
        InputError: a number is out of its range.
    """

    means: float = 1.28e-3
    """Learning rate of positions, as a fraction of the scene's extent."""
    # What Adam adds up to is the rate times the steps. Where that is far more than splats have to
    # move, they drift apart and shrink, in fits of 30,000 steps.
    means_steps: int = 1500
    """Number of steps up to which a run has this learning rate of positions; longer runs have a
    lower one, in inverse proportion to their steps (0 = the same in all runs)."""
    means_last: float = 0.01
    """Learning rate of positions at the cooldown, as a fraction of the first; it falls
    exponentially until then."""
    quats: float = 4e-3
    """Learning rate of quaternions."""
    log_scales: float = 2e-2
    """Learning rate of the logarithms of scales."""
    shapes_last: float = 1.0
    """Learning rates of quaternions and scales at the cooldown, as a fraction of the first; they
    fall exponentially until then."""
    logits: float = 5e-2
    """Learning rate of the logits of opacities, or of the logarithms of X-ray densities."""
    sh: float = 2.5e-3
    """Learning rate of the constant colour (spherical harmonic of degree 0)."""
    sh_rest: float = 1.0
    """Learning rate of harmonics of degree 1 and above, as a fraction of --learning-rates.sh."""
    pose_reach: float = 0.02
    """How far a camera can move in a run if poses are refined, about each axis in radians, along
    each as a fraction of the scene's extent; less in runs of few steps for each view. The learning
    rate follows from it."""
    shape_modes: float = 2.5e-3
    """Learning rate of the Hermite modes of splats' shapes."""
    # At 1e-2 both serve short fits better, but fits of order 2 were lost after some 1,500 steps.
    color_modes: float = 2.5e-3
    """Learning rate of the Hermite modes of splats' colours."""
    lobes: float = 1e-2
    """Learning rate of the geometry of lobes: quaternions or axes, and logarithms of widths."""
    lobes_rest: float = 1.0
    """Learning rate of the coefficients of lobes, as a fraction of --learning-rates.sh."""
    environment: float = 1e-2
    """Learning rate of the logarithms of an environment light's radiance."""
    reflectance: float = 5e-2
    """Learning rate of how splats reflect that light: logits of tints, logarithms of sharpness."""
    # Normals that learn drift: they come from the places of neighbours instead.
    normals: float = 0.0
    """Learning rate of the normals of splats that reflect that light; what they learn lasts until
    they are taken from the places of neighbours again, every 100 steps and whenever splats were
    relocated."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        for item in fields(self):
            if item.name == "means_steps":
                check_whole(self, item.name, 0)
            elif item.name in ("means_last", "shapes_last"):
                check_number(self, item.name, most=1, above=True)
            else:
                check_number(self, item.name)

    def first_means(self, steps: int) -> float:
        """Learning rate of positions at the first of so many steps."""
        return self.means * min(1.0, self.means_steps / steps) if self.means_steps else self.means


@dataclass(frozen=True)
class TrainSettings:
    """Settings of a fit.

    Raises:
        InputError: a number is out of its range.
    """

    steps: Short[int] = 3000
    """Number of optimization steps (one training image each)."""
    splats: ShortSplats[int] = 20_000
    """Largest number of splats."""
    seed: Short[int] = 0
    """Random seed; the same seed gives the same splats, bit by bit."""
    sh_degree: ShortSplats[int] = 3
    """Highest degree of the spherical harmonics of colours, 0 to 4."""
    sh_every: ShortExpert[float] = 1 / 14
    """Fraction of the run between one degree of the harmonics and the next; 0 = all from the first
    step on."""
    loss: Short[str] = "l1"
    """Pixel loss: absolute (l1) or squared (l2) differences, or the name of a registered one
    (rift_cl.train.register_loss)."""
    ssim_weight: Short[float] = 0.2
    """Fraction of 1 - SSIM in the loss; the rest is the pixel loss."""
    noise: Expert[ShortAuto[float]] = None
    """Standard deviation of the noise in the training images, in units of the image. Default:
    estimated from a few images where it matters, else none."""
    band_limit: ShortAuto[BandLimit] = None
    """Keep splats no finer than the cameras resolve: half a pixel of the finest camera (pixels,
    Mip-Splatting), or what all views determine above noise (coverage). Default: no limit."""
    cooldown: ShortExpert[float] = 0.12
    """Fraction of the run, at its end, without random walks and penalties and with falling
    learning rates."""
    refine_poses: Short[bool] = False
    """Optimize the camera poses."""
    refine_exposures: Short[bool] = False
    """Fit a gain and an offset of each image's colours."""
    basis: ShortSplats[BasisSettings] = field(default_factory=BasisSettings)
    """Hermite modes of the splats' shapes and colours, and how densities become opacities."""
    angular: ShortSplats[AngularSettings] = field(default_factory=AngularSettings)
    """Functions of the viewing direction that colours are made of; other kinds than sh take the
    place of all harmonics but the constant one."""
    environment: ShortSplats[EnvironmentSettings] = field(default_factory=EnvironmentSettings)
    """A light that all splats share and reflect."""
    octaves: Short[OctaveSettings] = field(default_factory=OctaveSettings)
    """How often images are halved at first."""
    surface: ShortSplats[SurfaceSettings] = field(default_factory=SurfaceSettings)
    """Priors that make splats lie on surfaces."""
    strategy: ShortExpert[StrategySettings] = field(
        default_factory=ResidualSettings,
        metadata={"registry": STRATEGIES, "without": ("xray",), "help": _STRATEGY_HELP},
    )
    """How splats are added, moved and removed."""
    homogenisation: Short[Homogenisation] = field(default_factory=Homogenisation)
    """Weight of spatial frequencies in the gradient of the pixel loss."""
    learning_rates: ShortExpert[LearningRates] = field(default_factory=LearningRates)
    """Adam's learning rates at the first step (0 = not trained)."""
    solve: NoOption[SolveSettings] = field(default_factory=SolveSettings)
    """Periodic least-squares solve for densities and shape modes (X-rays only)."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        for name, least in (("steps", 1), ("splats", 1), ("seed", 0)):
            check_whole(self, name, least)
        check_whole(self, "sh_degree", 0, 4)
        for name in ("ssim_weight", "cooldown", "sh_every"):
            check_number(self, name, most=1)
        if self.noise is not None:
            check_number(self, "noise")
        check_registered(self, "loss", PIXEL_LOSSES)
        if self.band_limit is not None and self.band_limit not in get_args(BandLimit):
            wanted = "None, " + " or ".join(get_args(BandLimit))
            raise SettingError(self, "band_limit", f"is {self.band_limit!r}, wanted {wanted}")
        if not isinstance(self.strategy, StrategySettings):
            raise SettingError(
                self,
                "strategy",
                f"is {self.strategy!r}, wanted the settings of one, such as ResidualSettings()",
            )
        absgrad = isinstance(self.strategy, DefaultSettings) and self.strategy.absgrad
        if absgrad and not self.basis.plain:
            raise SettingError(
                self.strategy,
                "absgrad",
                "wants magnitudes of screen gradients, which splats with modes or an activation do "
                "not have: leave it off",
            )

    @property
    def numbers(self) -> int:
        """Trained numbers of a splat at the end of the run."""
        basis, colors = self.basis, 3 * (self.degree + 1) ** 2
        shape, color = basis.orders
        modes = count_of(shape) - 1 + 3 * (count_of(color) - 1)
        return 11 + modes + (self.angular.numbers or colors) + self.environment.numbers

    @property
    def degree(self) -> int:
        """Highest degree of the harmonics of the splats' own colours; 0 where these are lobes."""
        if self.angular.kind != "sh":
            return 0
        return self.environment.own_degree if self.environment.shared else self.sh_degree

    @property
    def degree_joins(self) -> tuple[int, ...]:
        """Steps after which degrees 1, 2 .. of the harmonics join; none where colours are lobes."""
        return tuple(
            round(self.sh_every * self.steps * degree) for degree in range(1, self.degree + 1)
        )

    @property
    def needs_noise(self) -> bool:
        """Whether the noise of the training images decides something, and is not known."""
        heeded = bool(self.homogenisation.exponent) or self.band_limit == "coverage"
        return heeded and self.noise is None

    def decided(self: T, views: int) -> T:
        """These settings, with a value for what was left open.

        Args:
            views: number of training views.
        """
        return replace(
            self,
            basis=self.basis.decided(),
            homogenisation=self.homogenisation.decided(views),
            strategy=self.strategy.decided(),
        )
