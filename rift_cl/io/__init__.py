"""Files in and out: scans and pictures read, volumes and reports written.

The names are resolved when they are first used, so that importing the package loads none of the
file libraries.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rift_cl.lazy_names import lazy_names

if TYPE_CHECKING:
    from rift_cl.io.captures.capture import (
        Capture,
        View,
        camera_at,
        holds_bare_photographs,
        open_capture,
        read_known_view,
        read_view,
    )
    from rift_cl.io.captures.photographs import (
        PosedPhotographs,
        check_photographs,
        pose_photographs,
    )
    from rift_cl.io.images.display_light import to_display, to_linear
    from rift_cl.io.images.image import read_image, write_png
    from rift_cl.io.lenses.lens_file import open_lens
    from rift_cl.io.output import atomic_path, make_folder, write_json, write_text
    from rift_cl.io.scans.array_scan import scan_of_arrays
    from rift_cl.io.scans.formats import open_scan, register_scan_reader
    from rift_cl.io.scans.scan_file import ScanFile, ScanRequest, ScanRows
    from rift_cl.io.scenes.splat_scene import SplatScene
    from rift_cl.io.volumes import VolumeWriter, open_volume, read_volume, suggested_window


__all__ = [
    "Capture",
    "PosedPhotographs",
    "ScanFile",
    "ScanRequest",
    "ScanRows",
    "SplatScene",
    "View",
    "VolumeWriter",
    "atomic_path",
    "camera_at",
    "check_photographs",
    "holds_bare_photographs",
    "make_folder",
    "open_capture",
    "open_lens",
    "open_scan",
    "open_volume",
    "pose_photographs",
    "read_image",
    "read_known_view",
    "read_view",
    "read_volume",
    "register_scan_reader",
    "scan_of_arrays",
    "suggested_window",
    "to_display",
    "to_linear",
    "write_json",
    "write_png",
    "write_text",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "captures.capture": (
            "Capture",
            "View",
            "camera_at",
            "holds_bare_photographs",
            "open_capture",
            "read_known_view",
            "read_view",
        ),
        "captures.photographs": ("PosedPhotographs", "check_photographs", "pose_photographs"),
        "images.display_light": ("to_display", "to_linear"),
        "images.image": ("read_image", "write_png"),
        "lenses.lens_file": ("open_lens",),
        "output": ("atomic_path", "make_folder", "write_json", "write_text"),
        "scans.array_scan": ("scan_of_arrays",),
        "scans.formats": ("open_scan", "register_scan_reader"),
        "scans.scan_file": ("ScanFile", "ScanRequest", "ScanRows"),
        "scenes.splat_scene": ("SplatScene",),
        "volumes": ("VolumeWriter", "open_volume", "read_volume", "suggested_window"),
    },
)
