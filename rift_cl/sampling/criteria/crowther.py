"""How many views it takes for a resolution, and what resolution the views at hand give.

Crowther, DeRosier and Klug (1970): K >= pi D / d even views of a target of diameter D for a
resolution d. The converse is taken for the set at hand: up to which frequency are its slices no
further apart than they are thick?
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.sampling.coverage.work import Views
from rift_cl.sampling.criteria.orlov import (
    frequency_directions,
    observed_directions,
    slice_gaps,
    wanted_frequency,
)
from rift_cl.sampling.targets.target import Target

# Share of directions that the converse of Crowther's count asks for: a small hole is left to
# Orlov's condition, one of more than a tenth counts here as well.
_MOST = 0.9


@dataclass(frozen=True)
class Crowther:
    """How many views it takes, and how far these go.

    Args:
        views: that see the point.
        needed: even views for the frequency that is wanted.
        wanted: that frequency.
        frequency: up to which 90 % of all directions lie on a slice of these views.
    """

    views: int
    needed: int
    wanted: float
    frequency: float

    @property
    def sentence(self) -> str:
        """The finding for a reader."""
        told = "1 view tells" if self.views == 1 else f"{self.views} views tell"
        return (
            f"{told} {_MOST:.0%} of all directions up to {self.frequency:.3g} "
            f"cycles per unit (a resolution of {1 / self.frequency:.3g}); for "
            f"{self.wanted:.3g} along one circle it takes {self.needed}."
        )


def crowther(
    views: Views, target: Target, *, frequency: float | None = None, point: int = 0
) -> Crowther:
    """Crowther's count and its converse for these views, at one of the target's points.

    Args:
        views: cameras, a parallel scan about z, or ``Observations`` at the target's points.
        target: its diameter, points and band.
        frequency: that is wanted, in cycles per unit of length; the target's highest if not given.
        point: number of the point.

    Raises:
        ShapeError: there is no view.
        InputError: the point lies outside every picture, or the frequency is no frequency.
    """
    wanted = wanted_frequency(frequency, target)
    observed = observed_directions(views, target, point)
    gap = float(np.quantile(slice_gaps(observed, frequency_directions(target)), _MOST))
    reached = 0.5 / (target.diameter * max(gap, 1e-12))
    needed = crowther_views(target.diameter, 1 / wanted)
    return Crowther(len(observed), needed, wanted, reached)


def crowther_views(diameter: float, resolution: float) -> int:
    """The number of even views over half a turn for a resolution: K >= pi D / d.

    Raises:
        InputError: one of the lengths is not positive.
    """
    ratio = one_number(diameter) / one_number(resolution) if one_number(resolution) else math.nan
    if not 0 < ratio < math.inf:
        raise InputError(
            f"diameter is {diameter!r}, resolution {resolution!r}; wanted positive lengths"
        )
    # Not one more where rounding puts a whole number a hair above itself.
    return math.ceil(math.pi * ratio * (1 - 1e-12))
