"""Tomography and splatting on any OpenCL device.

    import rift_cl as rift

    grid = rift.Grid((512, 512))
    scan = rift.Parallel(angles, bins=726)
    A = rift.Projector(grid, scan)
    image = rift.fbp(A, sinogram)

Public names are looked up when they are first used, so that the import stays light and no OpenCL
driver is touched before there is work for one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rift_cl import metrics, phantom
    from rift_cl.cl import Device, default_device, devices, open_device
    from rift_cl.errors import RiftError
    from rift_cl.geometry import Camera, FanBeam, Grid, Parallel
    from rift_cl.io import SplatScene
    from rift_cl.operators import (
        FastProjector,
        HighPass,
        LinearOperator,
        Projector,
        Ramp,
        Response,
        dot_test,
    )
    from rift_cl.reconstruct import backproject, cgls, fbp, sirt, tv
    from rift_cl.splat import Renderer, Splats, SplatSettings

_HOMES = {
    "Camera": "geometry",
    "Device": "cl",
    "FanBeam": "geometry",
    "FastProjector": "operators",
    "Grid": "geometry",
    "HighPass": "operators",
    "LinearOperator": "operators",
    "Parallel": "geometry",
    "Projector": "operators",
    "Ramp": "operators",
    "Renderer": "splat",
    "Response": "operators",
    "RiftError": "errors",
    "SplatScene": "io",
    "SplatSettings": "splat",
    "Splats": "splat",
    "backproject": "reconstruct",
    "cgls": "reconstruct",
    "default_device": "cl",
    "devices": "cl",
    "dot_test": "operators",
    "fbp": "reconstruct",
    "open_device": "cl",
    "sirt": "reconstruct",
    "tv": "reconstruct",
}
_MODULES = ("metrics", "phantom")

__all__ = [
    "Camera",
    "Device",
    "FanBeam",
    "FastProjector",
    "Grid",
    "HighPass",
    "LinearOperator",
    "Parallel",
    "Projector",
    "Ramp",
    "Renderer",
    "Response",
    "RiftError",
    "SplatScene",
    "SplatSettings",
    "Splats",
    "backproject",
    "cgls",
    "default_device",
    "devices",
    "dot_test",
    "fbp",
    "metrics",
    "open_device",
    "phantom",
    "sirt",
    "tv",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"rift_cl.{name}")
    if name in _HOMES:
        return getattr(import_module(f"rift_cl.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'rift_cl' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
