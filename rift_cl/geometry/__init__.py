"""Where things are: grids of samples, scans and cameras that look at them. Values, no OpenCL."""

from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.fan import FanBeam
from rift_cl.geometry.grid import Grid
from rift_cl.geometry.scan import Parallel
from rift_cl.optics.camera_reduction import reduce_camera
from rift_cl.optics.gaussian_lens import GaussianLens
from rift_cl.optics.lens_prescription import LensPrescription

__all__ = [
    "Aperture",
    "Camera",
    "CameraType",
    "FanBeam",
    "GaussianLens",
    "Grid",
    "LensPrescription",
    "Parallel",
    "reduce_camera",
]
