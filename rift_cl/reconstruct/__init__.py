"""Reconstruction methods, one file each; they see operators only."""

from rift_cl.reconstruct.center import CenterSearch, find_center
from rift_cl.reconstruct.conjugate_gradients import Cgls, cgls
from rift_cl.reconstruct.filtered_backprojection import FilteredBackprojection, backproject, fbp
from rift_cl.reconstruct.fista import Fista
from rift_cl.reconstruct.flatfield import Attenuation, attenuation
from rift_cl.reconstruct.pdhg import Pdhg
from rift_cl.reconstruct.simultaneous_iteration import Sirt, sirt
from rift_cl.reconstruct.tv_reconstruction import tv

__all__ = [
    "Attenuation",
    "CenterSearch",
    "Cgls",
    "FilteredBackprojection",
    "Fista",
    "Pdhg",
    "Sirt",
    "attenuation",
    "backproject",
    "cgls",
    "fbp",
    "find_center",
    "sirt",
    "tv",
]
