"""How splats are fitted to pictures: every switch of the trainer, in frozen values."""

from __future__ import annotations

from dataclasses import dataclass, field

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number

_DEGREES = (0, 1, 2, 3, 4)


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
    """

    means: float = 1.6e-4
    means_last: float = 0.01
    quats: float = 1e-3
    log_scales: float = 5e-3
    logits: float = 5e-2
    sh: float = 2.5e-3
    sh_rest: float = 0.2


@dataclass(frozen=True)
class Renewal:
    """Splats that have faded move to where others have much to do (3DGS as MCMC).

    Args:
        every: steps between two renewals.
        first: step of the first one.
        last: share of the steps after which there are none.
        growth: share by which the number of splats grows at each, up to the most there may be.
        faint: opacity up to which a splat counts as faded.
        noise: of the random walk, as a multiple of the positions' rate.
        opacity_penalty: weight of the mean opacity in the loss.
        scale_penalty: weight of the mean scale in the loss, per extent of the scene.
    """

    every: int = 100
    first: int = 500
    last: float = 0.85
    growth: float = 0.05
    faint: float = 0.005
    noise: float = 5e5
    opacity_penalty: float = 0.01
    scale_penalty: float = 0.01


@dataclass(frozen=True)
class TrainSettings:
    """What a fit is made with.

    Args:
        steps: pictures that are looked at, one after the other.
        seed: of everything that is random.
        splats: most splats.
        sh_degree: of the colours' harmonics, 0 to 4.
        sh_every: steps after which the next degree joins.
        ssim_weight: share of D-SSIM in the loss; the rest is L1.
        finish: share of the steps, at the end, without noise and penalties and with fading rates.
        rates: of Adam.
        renewal: of splats that have faded.

    Raises:
        InputError: a number is out of its range.
    """

    steps: int = 3000
    seed: int = 0
    splats: int = 20_000
    sh_degree: int = 3
    sh_every: int = 500
    ssim_weight: float = 0.2
    finish: float = 0.12
    rates: Rates = field(default_factory=Rates)
    renewal: Renewal = field(default_factory=Renewal)

    def __post_init__(self) -> None:
        """Check every number's range."""
        for name, least in (("steps", 1), ("splats", 1), ("sh_every", 1), ("seed", 0)):
            value = one_number(getattr(self, name))
            if not (value >= least and value.is_integer()):
                raise InputError(
                    f"TrainSettings: {name} is {getattr(self, name)!r}, wanted a whole number >= "
                    f"{least}"
                )
        if self.sh_degree not in _DEGREES:
            raise InputError(f"TrainSettings: sh_degree is {self.sh_degree!r}, wanted 0 to 4")
        for name in ("ssim_weight", "finish"):
            if not 0 <= one_number(getattr(self, name)) <= 1:
                raise InputError(f"TrainSettings: {name} is {getattr(self, name)!r}, wanted 0 to 1")
