"""Tomography and splatting on any OpenCL device.

    import rift_cl as rift

    grid = rift.Grid((512, 512))
    scan = rift.Parallel(angles, bins=726)
    A = rift.Projector(grid, scan)
    image = rift.fbp(A, sinogram)

    fitted = rift.fit("capture", steps=3000)  # what the commands do, as functions
    film = rift.render(fitted, "film")

Public names are looked up when they are first used, so that the import stays light and no OpenCL
driver is touched before there is work for one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rift_cl import basis, metrics, phantom
    from rift_cl.cl import Device, default_device, devices, open_device
    from rift_cl.commands.functions import (
        analyze,
        evaluate,
        export,
        fit,
        plan_views,
        reconstruct_scan,
        render,
    )
    from rift_cl.errors import RiftError
    from rift_cl.geometry import Aperture, Camera, CameraType, FanBeam, Grid, Parallel
    from rift_cl.io import (
        SplatScene,
        open_capture,
        open_lens,
        open_scan,
        register_scan_reader,
        scan_of_arrays,
    )
    from rift_cl.operators import (
        FastProjector,
        HighPass,
        LinearOperator,
        Projector,
        Ramp,
        Response,
        cheapest_projector,
        dot_test,
        register_filter,
    )
    from rift_cl.reconstruct import AxisEstimate, backproject, cgls, fbp, find_center, sirt, tv
    from rift_cl.sampling import Constraints, Observations, Plan, Target, next_views, plan
    from rift_cl.sampling.coverage.device import coverage
    from rift_cl.sampling.criteria.merit import merit
    from rift_cl.splat import Renderer, Splats, SplatSettings

_HOMES = {
    "Aperture": "geometry",
    "AxisEstimate": "reconstruct",
    "Camera": "geometry",
    "CameraType": "geometry",
    "Constraints": "sampling",
    "Device": "cl",
    "FanBeam": "geometry",
    "FastProjector": "operators",
    "Grid": "geometry",
    "HighPass": "operators",
    "LinearOperator": "operators",
    "Observations": "sampling",
    "Parallel": "geometry",
    "Plan": "sampling",
    "Projector": "operators",
    "Ramp": "operators",
    "Renderer": "splat",
    "Response": "operators",
    "RiftError": "errors",
    "SplatScene": "io",
    "SplatSettings": "splat",
    "Splats": "splat",
    "Target": "sampling",
    "analyze": "commands.functions",
    "backproject": "reconstruct",
    "cgls": "reconstruct",
    "cheapest_projector": "operators",
    "coverage": "sampling.coverage.device",
    "default_device": "cl",
    "devices": "cl",
    "dot_test": "operators",
    "evaluate": "commands.functions",
    "export": "commands.functions",
    "fbp": "reconstruct",
    "find_center": "reconstruct",
    "fit": "commands.functions",
    "merit": "sampling.criteria.merit",
    "next_views": "sampling",
    "open_capture": "io",
    "open_device": "cl",
    "open_lens": "io",
    "open_scan": "io",
    "plan": "sampling",
    "plan_views": "commands.functions",
    "reconstruct_scan": "commands.functions",
    "register_filter": "operators",
    "register_scan_reader": "io",
    "render": "commands.functions",
    "scan_of_arrays": "io",
    "sirt": "reconstruct",
    "tv": "reconstruct",
}
_MODULES = ("basis", "metrics", "phantom")

__all__ = [
    "Aperture",
    "AxisEstimate",
    "Camera",
    "CameraType",
    "Constraints",
    "Device",
    "FanBeam",
    "FastProjector",
    "Grid",
    "HighPass",
    "LinearOperator",
    "Observations",
    "Parallel",
    "Plan",
    "Projector",
    "Ramp",
    "Renderer",
    "Response",
    "RiftError",
    "SplatScene",
    "SplatSettings",
    "Splats",
    "Target",
    "analyze",
    "backproject",
    "basis",
    "cgls",
    "cheapest_projector",
    "coverage",
    "default_device",
    "devices",
    "dot_test",
    "evaluate",
    "export",
    "fbp",
    "find_center",
    "fit",
    "merit",
    "metrics",
    "next_views",
    "open_capture",
    "open_device",
    "open_lens",
    "open_scan",
    "phantom",
    "plan",
    "plan_views",
    "reconstruct_scan",
    "register_filter",
    "register_scan_reader",
    "render",
    "scan_of_arrays",
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
