"""Priors that make splats lie on surfaces: switched on where a scene is made of opaque things.

Photographs from one circle of views are explained by a fog as well as by a surface, and only the
surface looks right from elsewhere. Each prior is a term of the loss, a mean over all splats; with
all weights zero nothing of them is computed.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

from rift_cl.train.ranges import check_number


class SurfacePenalties(NamedTuple):
    """Weights of the priors in the loss of a step; ``SurfaceSettings`` says what they are."""

    flatness: float = 0.0
    opacity_entropy: float = 0.0
    normal_consistency: float = 0.0


@dataclass(frozen=True)
class SurfaceSettings:
    """Priors for surfaces, terms of the loss (0 = none).

    Raises:
        InputError: a number is out of its range.
    """

    flatness: float = 0.0
    """Weight of the mean of splats' smallest scales in the loss, with scales as shares of the size
    of the scene: splats become flat (PGSR, Chen et al. 2024)."""
    opacity_entropy: float = 0.0
    """Weight of the mean binary entropy of opacities in the loss, in nats: opacities go to 0 or 1
    (SuGaR, Guedon and Lepetit 2024)."""
    normal_consistency: float = 0.0
    """Weight in the loss of the mean squared sine between each splat's shortest axis and the normal
    of the sheet that its 24 nearest neighbours lie in, which is found anew every 100 steps."""
    first: float = 0.2
    """Fraction of the run after which these priors begin; they end with the cooldown."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        for item in fields(self):
            if item.name == "first":
                check_number(self, item.name, most=1)
            else:
                check_number(self, item.name)

    @property
    def wanted(self) -> bool:
        """Whether any prior is switched on."""
        return any(getattr(self, name) for name in SurfacePenalties._fields)

    def at(self, share: float) -> SurfacePenalties:
        """The weights after a share of a run's steps, the cooldown left out of account."""
        if share < self.first:
            return SurfacePenalties()
        return SurfacePenalties(*(getattr(self, name) for name in SurfacePenalties._fields))
