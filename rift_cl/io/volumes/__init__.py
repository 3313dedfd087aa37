"""Volumes (z, y, x) in the formats that other programs open.

``volume`` is the front: it opens a volume for writing and reads one back. Behind it stands one
file for each format, and what formats share: the samples' integers, the layout, ImageJ's notes.
"""

from rift_cl.io.volumes.sample_window import SampleWindow, suggested_window, whole_window
from rift_cl.io.volumes.volume import (
    VOLUME_NAMES,
    VolumeWriter,
    open_volume,
    other_volumes,
    read_volume,
    read_volume_place,
)

__all__ = [
    "VOLUME_NAMES",
    "SampleWindow",
    "VolumeWriter",
    "open_volume",
    "other_volumes",
    "read_volume",
    "read_volume_place",
    "suggested_window",
    "whole_window",
]
