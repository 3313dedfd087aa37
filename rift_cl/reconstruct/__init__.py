"""Reconstruction methods, one file each; they see operators only."""

from rift_cl.reconstruct.axis import AxisEstimate, find_center
from rift_cl.reconstruct.conjugate_gradients import Cgls, cgls
from rift_cl.reconstruct.direction_weights import DirectionWeights
from rift_cl.reconstruct.disc_prior import Disc, find_disc, material_lengths
from rift_cl.reconstruct.fan_rebin import rebin_fan
from rift_cl.reconstruct.few_levels import FewLevels
from rift_cl.reconstruct.filtered_backprojection import FilteredBackprojection, backproject, fbp
from rift_cl.reconstruct.fista import Fista
from rift_cl.reconstruct.flatfield import Attenuation, attenuation
from rift_cl.reconstruct.offset_axis import widened
from rift_cl.reconstruct.ordered_subsets import OrderedSubsets
from rift_cl.reconstruct.padding import extended
from rift_cl.reconstruct.pdhg import Pdhg
from rift_cl.reconstruct.poisson_weights import RayWeights, poisson_weights
from rift_cl.reconstruct.preprocess import remove_rings
from rift_cl.reconstruct.seen_rays import SeenRays
from rift_cl.reconstruct.simultaneous_iteration import Sirt, sirt
from rift_cl.reconstruct.tv_reconstruction import tv

__all__ = [
    "Attenuation",
    "AxisEstimate",
    "Cgls",
    "DirectionWeights",
    "Disc",
    "FewLevels",
    "FilteredBackprojection",
    "Fista",
    "OrderedSubsets",
    "Pdhg",
    "RayWeights",
    "SeenRays",
    "Sirt",
    "attenuation",
    "backproject",
    "cgls",
    "extended",
    "fbp",
    "find_center",
    "find_disc",
    "material_lengths",
    "poisson_weights",
    "rebin_fan",
    "remove_rings",
    "sirt",
    "tv",
    "widened",
]
