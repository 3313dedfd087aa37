"""What is noted beside a COLMAP model whose poses we had found, in ``poses.json``.

Such poses belong to photographs as they are shown, whatever EXIF says of how they are stored;
those that others found belong to photographs as they are stored.
"""

from __future__ import annotations

from pathlib import Path

from rift_cl.errors import RiftError
from rift_cl.io.json_fields import read_json_object

POSE_RECORD = "poses.json"


def is_upright(model: Path) -> bool:
    """Whether a COLMAP model says that its poses belong to photographs as they are shown."""
    try:
        record = read_json_object(model / POSE_RECORD)
    except RiftError:
        return False
    return record.values.get("upright") is True
