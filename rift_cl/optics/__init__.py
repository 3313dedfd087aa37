"""Lens optics: from a prescription to a camera, and which frequencies a camera passes."""

from rift_cl.optics.camera_reduction import reduce_camera
from rift_cl.optics.gaussian_lens import GaussianLens
from rift_cl.optics.lens_prescription import LensPrescription

__all__ = ["GaussianLens", "LensPrescription", "reduce_camera"]
