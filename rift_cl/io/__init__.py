"""Files in and out: scans and pictures read, volumes and reports written.

The names are resolved when they are first used, so that importing the package loads none of the
file libraries.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rift_cl.io.captures.capture import (
        Capture,
        View,
        camera_at,
        holds_bare_photographs,
        open_capture,
        read_view,
    )
    from rift_cl.io.captures.photographs import (
        PosedPhotographs,
        check_photographs,
        pose_photographs,
    )
    from rift_cl.io.images.image import read_image, write_png
    from rift_cl.io.lenses.lens_file import open_lens
    from rift_cl.io.output import atomic_path, make_folder, write_json, write_text
    from rift_cl.io.scans.array_scan import scan_of_arrays
    from rift_cl.io.scans.formats import open_scan, register_scan_reader
    from rift_cl.io.scans.scan_file import ScanFile, ScanRequest, ScanRows
    from rift_cl.io.scenes.splat_scene import SplatScene
    from rift_cl.io.volumes import VolumeWriter, open_volume, read_volume, suggested_window

_HOMES = {
    "Capture": "captures.capture",
    "PosedPhotographs": "captures.photographs",
    "ScanFile": "scans.scan_file",
    "ScanRequest": "scans.scan_file",
    "ScanRows": "scans.scan_file",
    "SplatScene": "scenes.splat_scene",
    "View": "captures.capture",
    "VolumeWriter": "volumes",
    "atomic_path": "output",
    "camera_at": "captures.capture",
    "check_photographs": "captures.photographs",
    "holds_bare_photographs": "captures.capture",
    "make_folder": "output",
    "open_capture": "captures.capture",
    "open_lens": "lenses.lens_file",
    "open_scan": "scans.formats",
    "open_volume": "volumes",
    "pose_photographs": "captures.photographs",
    "read_image": "images.image",
    "read_view": "captures.capture",
    "read_volume": "volumes",
    "register_scan_reader": "scans.formats",
    "scan_of_arrays": "scans.array_scan",
    "suggested_window": "volumes",
    "write_json": "output",
    "write_png": "images.image",
    "write_text": "output",
}

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
    "read_view",
    "read_volume",
    "register_scan_reader",
    "scan_of_arrays",
    "suggested_window",
    "write_json",
    "write_png",
    "write_text",
]


def __getattr__(name: str) -> Any:
    """Load the module that holds a public name."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
