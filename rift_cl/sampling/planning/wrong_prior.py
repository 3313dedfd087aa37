"""What a plan loses where the spectrum that it was made for lies in other directions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rift_cl.sampling.planning.view_plan import Plan
from rift_cl.sampling.targets.directional_prior import turned

# Turns, in degrees, that are tried.
TURNS = (45, 90)
_EVEN = "fibonacci"


class WrongPrior(NamedTuple):
    """Values of the criterion if the spectrum is rotated; lower is better.

    Args:
        degrees: by how much it is turned, about the axis about which the plan does worst.
        planned: the plan's.
        even: that of as many evenly spread views, about the same axis.
    """

    degrees: int
    planned: float
    even: float

    @property
    def sentence(self) -> str:
        """The finding for a reader."""
        loses = self.planned > self.even
        return (
            f"If the spectrum lies turned by {self.degrees} degrees, {self.planned:.3g} of the "
            f"power stays unknown with the plan and {self.even:.3g} with evenly spread views: "
            f"{'trust it less (--prior-trust, --prior-blur)' if loses else 'the plan still pays'}."
        )


def if_wrong(plan: Plan) -> tuple[WrongPrior, ...]:
    """What the plan is worth if its prior is wrong, by turns.

    Empty for a prior that is alike in all directions, for a surface, whose prior lies in its
    planes, for a criterion that is no share of power, and without evenly spread views to compare
    with.
    """
    judged = plan.objective.elsewhere
    target = judged.design.target
    even = plan.baselines.get(_EVEN)
    if even is None or target.mode == "surface" or plan.objective.kind != "wiener":
        return ()
    if plan.isotropic:
        return ()
    axes = np.eye(3)[2:] if target.is_flat else plan.objective.design.constraints.axes
    found = []
    for degrees in TURNS:
        merits = []
        for axis in axes:
            prior = turned(target.prior, axis, math.radians(degrees))
            design = replace(judged.design, target=replace(target, prior=prior))
            other = replace(judged, design=design, asked=None)
            merits.append((other.value(plan.view_table), other.value(even.view_table)))
        found.append(WrongPrior(degrees, *max(merits)))
    return tuple(found)
