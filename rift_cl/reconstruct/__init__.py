"""From projections to images: preprocessing, the rotation axis, direct and iterative methods.

Methods see linear operators only.
"""

from rift_cl.reconstruct.axis import AxisEstimate, find_center
from rift_cl.reconstruct.calibration import Calibration, calibrate
from rift_cl.reconstruct.direct.fan_rebin import rebin_fan
from rift_cl.reconstruct.direct.fdk import FDK
from rift_cl.reconstruct.direct.filtered_backprojection import (
    FilteredBackprojection,
    backproject,
    fbp,
)
from rift_cl.reconstruct.direct.katsevich import Katsevich
from rift_cl.reconstruct.direct.offset_axis import widened
from rift_cl.reconstruct.direct.padding import extended
from rift_cl.reconstruct.preprocess import remove_rings
from rift_cl.reconstruct.preprocess.flatfield import Attenuation, attenuation
from rift_cl.reconstruct.solvers.conjugate_gradients import Cgls, cgls, mean_diagonal
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights
from rift_cl.reconstruct.solvers.disc_prior import Disc, find_disc, material_lengths
from rift_cl.reconstruct.solvers.few_levels import FewLevels
from rift_cl.reconstruct.solvers.fista import Fista
from rift_cl.reconstruct.solvers.measured_rays import MeasuredRays
from rift_cl.reconstruct.solvers.operator_norm import operator_norm
from rift_cl.reconstruct.solvers.ordered_subsets import OrderedSubsets
from rift_cl.reconstruct.solvers.pdhg import Pdhg
from rift_cl.reconstruct.solvers.poisson_weights import RayWeights, poisson_weights
from rift_cl.reconstruct.solvers.simultaneous_iteration import Sirt, sirt
from rift_cl.reconstruct.solvers.tv import tv
from rift_cl.reconstruct.solvers.variation_weight import variation_weight

__all__ = [
    "FDK",
    "Attenuation",
    "AxisEstimate",
    "Calibration",
    "Cgls",
    "DirectionWeights",
    "Disc",
    "FewLevels",
    "FilteredBackprojection",
    "Fista",
    "Katsevich",
    "MeasuredRays",
    "OrderedSubsets",
    "Pdhg",
    "RayWeights",
    "Sirt",
    "attenuation",
    "backproject",
    "calibrate",
    "cgls",
    "extended",
    "fbp",
    "find_center",
    "find_disc",
    "material_lengths",
    "mean_diagonal",
    "operator_norm",
    "poisson_weights",
    "rebin_fan",
    "remove_rings",
    "sirt",
    "tv",
    "variation_weight",
    "widened",
]
