"""Which frequencies of a target a set of views samples (coverage), and which views to take (plans).

``coverage`` and ``merit`` are in modules of these names, and in ``rift_cl`` itself.
"""

from rift_cl.sampling.coverage.density import (
    half_circle,
    half_sphere,
    mean_density,
    power_slope,
    ring_density,
    window_width,
)
from rift_cl.sampling.criteria.merit import criterion_of_coverage
from rift_cl.sampling.planning.baselines import Baseline
from rift_cl.sampling.planning.constraints import Budget, Constraints, Ranges
from rift_cl.sampling.planning.keep_out import Box, Cone, KeepOut, Sphere
from rift_cl.sampling.planning.paths import Free, Ring, Spline, TiltedRings
from rift_cl.sampling.planning.planner import next_views, plan
from rift_cl.sampling.planning.view_plan import DiminishingReturns, Plan
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.pilot import Pilot
from rift_cl.sampling.targets.prior import PowerLaw, Prior, Spectrum
from rift_cl.sampling.targets.target import Target, half_ball, half_disc

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
    "Prior",
    "Ranges",
    "Ring",
    "Spectrum",
    "Sphere",
    "Spline",
    "Target",
    "TiltedRings",
    "criterion_of_coverage",
    "half_ball",
    "half_circle",
    "half_disc",
    "half_sphere",
    "mean_density",
    "next_views",
    "plan",
    "power_slope",
    "ring_density",
    "window_width",
]
