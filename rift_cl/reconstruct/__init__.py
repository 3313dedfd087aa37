"""Reconstruction methods, one file each; they see operators only."""

from rift_cl.reconstruct.fbp import FilteredBackprojection, backproject, fbp

__all__ = ["FilteredBackprojection", "backproject", "fbp"]
