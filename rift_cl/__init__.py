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

from typing import TYPE_CHECKING

from rift_cl.lazy_names import lazy_names

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rift_cl import (
        basis,
        cl,
        errors,
        geometry,
        io,
        metrics,
        operators,
        optics,
        phantom,
        reconstruct,
        sample,
        sampling,
        splat,
        train,
    )
    from rift_cl.cl import Device, default_device, devices, open_device
    from rift_cl.commands.functions import (
        analyze,
        evaluate,
        export,
        fit,
        plan_views,
        reconstruct_scan,
        render,
        view,
    )
    from rift_cl.errors import RiftError
    from rift_cl.geometry import (
        Aperture,
        Camera,
        CameraType,
        Cone,
        Fan,
        FanBeam,
        Grid,
        Parallel,
        Vectors,
    )
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
        HostOperator,
        LinearOperator,
        Projector,
        Ramp,
        Response,
        cheapest_projector,
        dot_test,
        register_filter,
        vstack,
    )
    from rift_cl.progress import Report
    from rift_cl.reconstruct import (
        AxisEstimate,
        Calibration,
        backproject,
        calibrate,
        cgls,
        fbp,
        find_center,
        operator_norm,
        sirt,
        tv,
    )
    from rift_cl.report.shown import show
    from rift_cl.sampling import Constraints, Observations, Plan, Target, next_views, plan
    from rift_cl.sampling.coverage.device import coverage
    from rift_cl.sampling.criteria.merit import merit
    from rift_cl.splat import Renderer, Splats, SplatSettings


__all__ = [
    "Aperture",
    "AxisEstimate",
    "Calibration",
    "Camera",
    "CameraType",
    "Cone",
    "Constraints",
    "Device",
    "Fan",
    "FanBeam",
    "FastProjector",
    "Grid",
    "HighPass",
    "HostOperator",
    "LinearOperator",
    "Observations",
    "Parallel",
    "Plan",
    "Projector",
    "Ramp",
    "Renderer",
    "Report",
    "Response",
    "RiftError",
    "SplatScene",
    "SplatSettings",
    "Splats",
    "Target",
    "Vectors",
    "analyze",
    "backproject",
    "basis",
    "calibrate",
    "cgls",
    "cheapest_projector",
    "cl",
    "coverage",
    "default_device",
    "devices",
    "dot_test",
    "errors",
    "evaluate",
    "export",
    "fbp",
    "find_center",
    "fit",
    "geometry",
    "io",
    "merit",
    "metrics",
    "next_views",
    "open_capture",
    "open_device",
    "open_lens",
    "open_scan",
    "operator_norm",
    "operators",
    "optics",
    "phantom",
    "plan",
    "plan_views",
    "reconstruct",
    "reconstruct_scan",
    "register_filter",
    "register_scan_reader",
    "render",
    "sample",
    "sampling",
    "scan_of_arrays",
    "show",
    "sirt",
    "splat",
    "train",
    "tv",
    "view",
    "vstack",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "": (
            "basis",
            "cl",
            "errors",
            "geometry",
            "io",
            "metrics",
            "operators",
            "optics",
            "phantom",
            "reconstruct",
            "sample",
            "sampling",
            "splat",
            "train",
        ),
        "cl": ("Device", "default_device", "devices", "open_device"),
        "commands.functions": (
            "analyze",
            "evaluate",
            "export",
            "fit",
            "plan_views",
            "reconstruct_scan",
            "render",
            "view",
        ),
        "errors": ("RiftError",),
        "geometry": (
            "Aperture",
            "Camera",
            "CameraType",
            "Cone",
            "Fan",
            "FanBeam",
            "Grid",
            "Parallel",
            "Vectors",
        ),
        "io": (
            "SplatScene",
            "open_capture",
            "open_lens",
            "open_scan",
            "register_scan_reader",
            "scan_of_arrays",
        ),
        "operators": (
            "FastProjector",
            "HighPass",
            "HostOperator",
            "LinearOperator",
            "Projector",
            "Ramp",
            "Response",
            "cheapest_projector",
            "dot_test",
            "register_filter",
            "vstack",
        ),
        "progress": ("Report",),
        "reconstruct": (
            "AxisEstimate",
            "Calibration",
            "backproject",
            "calibrate",
            "cgls",
            "fbp",
            "find_center",
            "operator_norm",
            "sirt",
            "tv",
        ),
        "report.shown": ("show",),
        "sampling": ("Constraints", "Observations", "Plan", "Target", "next_views", "plan"),
        "sampling.coverage.device": ("coverage",),
        "sampling.criteria.merit": ("merit",),
        "splat": ("Renderer", "SplatSettings", "Splats"),
    },
)
