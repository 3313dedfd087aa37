"""Which frequencies of a target a set of views samples (coverage), and which views to take (plans).

``coverage`` and ``merit`` are in modules of these names, and in ``rift_cl`` itself.
"""

from rift_cl.sampling.planning.baselines import Baseline
from rift_cl.sampling.planning.constraints import Budget, Constraints, Ranges
from rift_cl.sampling.planning.keep_out import Box, Cone, KeepOut, Sphere
from rift_cl.sampling.planning.paths import Free, Ring, Spline, TiltedRings
from rift_cl.sampling.planning.planner import next_views, plan
from rift_cl.sampling.planning.view_plan import DiminishingReturns, Plan
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.pilot import Pilot
from rift_cl.sampling.targets.prior import PowerLaw, Spectrum
from rift_cl.sampling.targets.target import Target

__all__ = [
    "Baseline",
    "Box",
    "Budget",
    "Cone",
    "Constraints",
    "DiminishingReturns",
    "Free",
    "KeepOut",
    "Observations",
    "Pilot",
    "Plan",
    "PowerLaw",
    "Ranges",
    "Ring",
    "Spectrum",
    "Sphere",
    "Spline",
    "Target",
    "TiltedRings",
    "next_views",
    "plan",
]
