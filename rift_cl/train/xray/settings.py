"""Settings of a fit to X-ray projections: those of every fit, with defaults for densities.

What has no meaning for line integrals, which have no colour, is no option here.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TypeVar

from rift_cl.errors import SettingError
from rift_cl.option_marks import Expert, NoOption, Short, ShortExpert, ShortSplats
from rift_cl.splat.settings import Activation
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.environment_settings import EnvironmentSettings
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.octave_settings import OctaveSettings
from rift_cl.train.settings import LearningRates, TrainSettings
from rift_cl.train.strategy import StrategySettings, XraySettings
from rift_cl.train.surface_settings import SurfaceSettings
from rift_cl.train.xray.solve_settings import SolveSettings

X = TypeVar("X", bound="XrayTrainSettings")


@dataclass(frozen=True)
class XrayLearningRates(LearningRates):
    """Adam's learning rates of densities at the first step; 0 = not trained."""

    # The start is near already, so that positions need not slow down by much.
    means: float = 3e-4
    """Learning rate of positions, as a fraction of the scene's extent, which is 2.6 times the
    distance from the rotation axis to the outermost ray."""
    means_steps: int = 0
    means_last: float = 0.1
    quats: float = 2e-2
    log_scales: float = 2e-2
    logits: float = 2e-2
    sh: NoOption[float] = 0.0
    sh_rest: NoOption[float] = 0.2
    pose_reach: NoOption[float] = 0.02
    exposures: NoOption[float] = 1e-2
    color_modes: NoOption[float] = 2.5e-3
    lobes: NoOption[float] = 1e-2
    lobes_rest: NoOption[float] = 1.0
    environment: NoOption[float] = 1e-2
    reflectance: NoOption[float] = 5e-2
    normals: NoOption[float] = 0.0


@dataclass(frozen=True)
class XrayBasisSettings(BasisSettings):
    """Hermite modes of the splats' densities."""

    color_order: NoOption[int | None] = 0
    activation: NoOption[Activation] = "clamp"
    # In a loss of squares that is far smaller than that of photographs.
    ridge: Expert[float] = 1e-5


@dataclass(frozen=True)
class XrayTrainSettings(TrainSettings):
    """Settings of a fit to X-ray projections."""

    sh_degree: NoOption[int] = 0
    sh_every: NoOption[float] = 1 / 6
    loss: Short[str] = "l2"
    ssim_weight: Short[float] = 0.0
    refine_poses: NoOption[bool] = False
    refine_exposures: NoOption[bool] = False
    basis: ShortSplats[BasisSettings] = field(default_factory=XrayBasisSettings)
    angular: NoOption[AngularSettings] = field(default_factory=AngularSettings)
    environment: NoOption[EnvironmentSettings] = field(default_factory=EnvironmentSettings)
    octaves: NoOption[OctaveSettings] = field(default_factory=lambda: OctaveSettings(0))
    surface: NoOption[SurfaceSettings] = field(default_factory=SurfaceSettings)
    strategy: ShortExpert[StrategySettings] = field(default_factory=XraySettings)
    # Orbits are dense along the detector's rows, and along nothing else.
    homogenisation: Short[Homogenisation] = field(
        default_factory=lambda: Homogenisation(along_rows=True)
    )
    learning_rates: ShortExpert[LearningRates] = field(default_factory=XrayLearningRates)
    solve: Short[SolveSettings] = field(default_factory=SolveSettings)

    def __post_init__(self) -> None:
        """Check every number's range, and that nothing is wanted that X-rays do not have."""
        super().__post_init__()
        if self.environment.shared:
            raise SettingError(
                self.environment, "kind", "is 'shared', but X-rays are not reflected: wanted none"
            )
        if self.surface.wanted:
            raise SettingError(
                "TrainSettings", "surface", "asks for surfaces, which X-rays pass: wanted none"
            )

    def decided(self: X, views: int) -> X:
        """These settings, with a value for what was left open.

        Between solves densities and modes stay as they are, which serves better than moving them by
        Adam as well.
        """
        found = super().decided(views)
        if not self.solve.every:
            return found
        rates = replace(self.learning_rates, logits=0.0, shape_modes=0.0)
        return replace(found, learning_rates=rates)
