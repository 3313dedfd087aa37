"""Reconstruction methods, one file each; they see operators only."""

from rift_cl.reconstruct.center import CenterSearch, find_center
from rift_cl.reconstruct.filtered_backprojection import FilteredBackprojection, backproject, fbp
from rift_cl.reconstruct.flatfield import Attenuation, attenuation

__all__ = [
    "Attenuation",
    "CenterSearch",
    "FilteredBackprojection",
    "attenuation",
    "backproject",
    "fbp",
    "find_center",
]
