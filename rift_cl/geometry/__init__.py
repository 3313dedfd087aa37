"""Grids of samples, scans, cameras and poses: frozen values that are checked, without OpenCL."""

from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.at_axis import at_axis
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.cone import Cone
from rift_cl.geometry.fan import Fan, FanBeam
from rift_cl.geometry.grid import Grid
from rift_cl.geometry.pose import look_at
from rift_cl.geometry.scan import Parallel
from rift_cl.geometry.vectors import Vectors

Scan = Parallel | Fan | Cone | Vectors

__all__ = [
    "Aperture",
    "Camera",
    "CameraType",
    "Cone",
    "Fan",
    "FanBeam",
    "Grid",
    "Parallel",
    "Scan",
    "Vectors",
    "at_axis",
    "look_at",
]
