"""How splats are fitted to pictures: every switch of the trainer, in frozen values."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal, get_args

from rift_cl.errors import InputError
from rift_cl.splat.orders import count_of
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.ranges import check_choice, check_number, check_whole
from rift_cl.train.xray.solve_settings import SolveSettings

LossKind = Literal["l1", "l2"]
StrategyName = Literal["mcmc", "default"]
BandLimit = Literal["pixels", "coverage"]


@dataclass(frozen=True)
class Rates:
    """Learning rates of Adam, of the values that are trained (3DGS, Kerbl et al. 2023).

    Args:
        means: first rate of positions, as a share of the scene's extent.
        means_last: last rate of positions, as a share of the first; it falls exponentially.
        quats: of quaternions.
        log_scales: of the logarithms of scales.
        logits: of opacities' logits.
        sh: of the constant harmonic.
        sh_rest: of the others, as a share of that.
        poses: of the cameras' turns, in radians, and shifts, in extents of the scene; falls as
            that of positions does. At 0 the cameras stay where they are.
        exposures: of each photograph's gains and offsets; falls likewise. At 0 there are none.
        shape_modes: of the Hermite modes of splats' shapes.
        color_modes: of those of their colours. At 1e-2 both serve short fits better, but fits of
            order 2 were lost after some 1,500 steps.
        lobes: of the geometry of lobes: quaternions or axes, and logarithms of widths.
        lobes_rest: of the lobes' coefficients, as a share of ``sh``.

    Raises:
        InputError: a number is out of its range.
    """

    means: float = 1.6e-4
    means_last: float = 0.01
    quats: float = 1e-3
    log_scales: float = 5e-3
    logits: float = 5e-2
    sh: float = 2.5e-3
    sh_rest: float = 0.2
    poses: float = 0.0
    exposures: float = 0.0
    shape_modes: float = 2.5e-3
    color_modes: float = 2.5e-3
    lobes: float = 1e-2
    lobes_rest: float = 1.0

    def __post_init__(self) -> None:
        """Check every number's range: a rate of 0 holds a group still."""
        for item in fields(self):
            if item.name != "means_last":
                check_number(self, item.name)
        check_number(self, "means_last", most=1, above=True)


@dataclass(frozen=True)
class Relocation:
    """Splats that have faded move to where others have much to do (3DGS as MCMC).

    Args:
        every: steps between two renewals.
        first: step of the first one.
        last: share of the steps after which there are none.
        growth: share by which the number of splats grows at each, up to the most there may be;
            more where the run would be too short for it.
        full: share of the steps after which there should be as many as there may be.
        faint: opacity up to which a splat counts as faded.
        noise: of the random walk, as a multiple of the positions' rate.
        opacity_penalty: weight of the mean opacity in the loss.
        scale_penalty: weight of the mean scale in the loss, per extent of the scene.

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 100
    first: int = 500
    last: float = 0.85
    growth: float = 0.05
    full: float = 0.5
    faint: float = 0.005
    noise: float = 5e5
    opacity_penalty: float = 0.01
    scale_penalty: float = 0.01

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_whole(self, "every", 1)
        check_whole(self, "first", 0)
        for name in ("last", "full", "faint"):
            check_number(self, name, most=1)
        for name in ("growth", "noise", "opacity_penalty", "scale_penalty"):
            check_number(self, name)


@dataclass(frozen=True)
class Densification:
    """Splats are cloned, split and pruned (3DGS, Kerbl et al. 2023; constants of gsplat 1.5).

    The original counts steps of a run of 30,000: the first densification at 500, the last before
    15,000, opacities reset every 3,000. What follows from the course of the run is a share of its
    steps here, so that 30,000 give the original's numbers. What follows from how fast Adam moves
    is not: a mean gradient wants as many pictures in a short run, and an opacity takes as many
    steps to come back after a reset.

    Args:
        every: steps between two densifications, over which gradients are averaged.
        first: share of the steps before the first one.
        last: share of the steps after which there are none, and no resets.
        gradient: mean gradient from which a splat is cloned or split, by its place in an image
            from -1 to 1; 2e-4 if not given, 8e-4 with ``absgrad``.
        absgrad: go by the sum of the gradient's magnitudes over pixels (AbsGS).
        small: largest scale of splats that are cloned rather than split, in extents of the scene.
        faint: opacity below which splats are pruned; a reset leaves no opacity above twice that.
        large: scale above which splats are pruned after the first reset, in extents of the scene.
        large_on_screen: the same for the radius on the screen, as a share of the image's larger
            side, 0.15 say; None for never, as in gsplat.
        reset: share of the steps between two resets of opacities; 0 for none.
        reset_least: but so many steps at least.
        revised_opacity: give two splats in place of one the opacity 1 - sqrt(1 - o), with which
            they hide together what one did (Rota Bulo et al. 2024).

    Raises:
        InputError: a number is out of its range.
    """

    every: int = 100
    first: float = 1 / 60
    last: float = 0.5
    gradient: float | None = None
    absgrad: bool = False
    small: float = 0.01
    faint: float = 0.005
    large: float = 0.1
    large_on_screen: float | None = None
    reset: float = 0.1
    reset_least: int = 500
    revised_opacity: bool = False

    def __post_init__(self) -> None:
        """Check every number's range."""
        for name in ("every", "reset_least"):
            check_whole(self, name, 1)
        for name in ("first", "last", "reset"):
            check_number(self, name, most=1)
        for name in ("gradient", "large_on_screen"):
            if getattr(self, name) is not None:
                check_number(self, name, above=True)
        for name in ("small", "large"):
            check_number(self, name, above=True)
        check_number(self, "faint", most=0.25, above=True)
        if self.small > self.large:
            raise InputError(
                f"Densification: small is {self.small!r} and large is {self.large!r}, wanted "
                "small <= large"
            )

    @property
    def threshold(self) -> float:
        """The mean gradient from which a splat is cloned or split."""
        return self.gradient or (8e-4 if self.absgrad else 2e-4)


@dataclass(frozen=True)
class TrainSettings:
    """What a fit is made with.

    Args:
        steps: pictures that are looked at, one after the other.
        seed: of everything that is random.
        splats: most splats.
        sh_degree: of the colours' harmonics, 0 to 4.
        sh_every: steps after which the next degree joins.
        loss: of pixels, ``l1`` or ``l2``.
        ssim_weight: share of D-SSIM in the loss; the rest is that of pixels.
        homogenisation: weight of high frequencies in the loss of pixels.
        noise: standard deviation of the noise in the pictures; none if not given.
        band_limit: let no splat be finer than what the cameras resolve: half a pixel of the finest
            camera (``pixels``, Mip-Splatting), or what all know above noise (``coverage``).
        finish: share of the steps, at the end, without noise and penalties and with fading rates.
        rates: of Adam.
        strategy: where splats come from and go to: ``mcmc`` renews them with random walks and
            penalties, ``default`` densifies as 3DGS did at first, with neither.
        renewal: of splats that have faded, with ``mcmc``.
        densification: with ``default``.
        basis: Hermite modes of the splats' shapes and colours, and how densities become opacities.
        angular: what colours vary in with the direction they are seen from; anything but ``sh``
            takes the place of the harmonics, all but the constant one.
        solve: what is linear is solved for now and then; X-rays alone.

    Raises:
        InputError: a number is out of its range.
    """

    steps: int = 3000
    seed: int = 0
    splats: int = 20_000
    sh_degree: int = 3
    sh_every: int = 500
    loss: LossKind = "l1"
    ssim_weight: float = 0.2
    homogenisation: Homogenisation = field(default_factory=Homogenisation)
    noise: float | None = None
    band_limit: BandLimit | None = None
    finish: float = 0.12
    rates: Rates = field(default_factory=Rates)
    strategy: StrategyName = "mcmc"
    relocation: Relocation = field(default_factory=Relocation)
    densification: Densification = field(default_factory=Densification)
    basis: BasisSettings = field(default_factory=BasisSettings)
    angular: AngularSettings = field(default_factory=AngularSettings)
    solve: SolveSettings = field(default_factory=SolveSettings)

    def __post_init__(self) -> None:
        """Check every number's range."""
        for name, least in (("steps", 1), ("splats", 1), ("sh_every", 1), ("seed", 0)):
            check_whole(self, name, least)
        check_whole(self, "sh_degree", 0, 4)
        for name in ("ssim_weight", "finish"):
            check_number(self, name, most=1)
        if self.noise is not None:
            check_number(self, "noise")
        check_choice(self, "loss", get_args(LossKind))
        if self.band_limit is not None and self.band_limit not in get_args(BandLimit):
            wanted = "None, " + " or ".join(get_args(BandLimit))
            raise InputError(f"TrainSettings: band_limit is {self.band_limit!r}, wanted {wanted}")
        check_choice(self, "strategy", get_args(StrategyName))
        if self.densification.absgrad and not self.basis.plain:
            raise InputError(
                "TrainSettings: densification.absgrad wants magnitudes of screen gradients, which "
                "splats with modes or an activation do not have: leave it off"
            )

    @property
    def numbers(self) -> int:
        """Parameters that a splat has in the end."""
        basis, colors = self.basis, 3 * (self.sh_degree + 1) ** 2
        modes = count_of(basis.order) - 1 + 3 * (count_of(basis.color_order) - 1)
        return 11 + modes + (self.angular.numbers or colors)
