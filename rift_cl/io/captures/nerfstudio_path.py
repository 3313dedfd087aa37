"""Camera paths of nerfstudio's viewer, as the transforms.json that says the same.

The file has a list 'camera_path' of poses, camera-to-world with OpenGL's axes, sixteen numbers row
by row, and vertical fields of view in degrees ('fov'); 'render_width' and 'render_height' are the
size of all frames, whose middle is the principal point. The shape of the viewer's window
('aspect') and the film's time ('fps', 'seconds') are left alone, as nerfstudio's own renderer
leaves the first.
"""

from __future__ import annotations

from typing import Any

from rift_cl.errors import FileFormatError
from rift_cl.io.json_fields import Fields

_PATH, _POSE, _ROW = "camera_path", "camera_to_world", 4


def is_camera_path(top: Fields) -> bool:
    """Whether a JSON object is such a path, and no list of photographs."""
    return _PATH in top and "frames" not in top


def as_transforms(top: Fields) -> Fields:
    """The same cameras in the fields of a transforms.json.

    Raises:
        FileFormatError: a field is missing or has the wrong type, or cameras are no pinholes.
        NonFiniteError: a number is NaN or infinite.
    """
    kind = top.text("camera_type")
    if kind not in (None, "perspective"):
        raise FileFormatError(
            f"{top.where}: 'camera_type' is {kind!r}, of which no frames are drawn; wanted "
            "'perspective'"
        )
    size = {"w": top.whole("render_width"), "h": top.whole("render_height")}
    frames = [_frame(camera) for camera in top.objects(_PATH)]
    return Fields(top.where, {**size, "frames": frames})


def _frame(camera: Fields) -> dict[str, Any]:
    pose = camera.numbers(_POSE)
    if pose is None or len(pose) != _ROW**2:
        raise FileFormatError(
            f"{camera.where}: {_POSE!r} has {len(pose or ())} numbers, wanted {_ROW**2}, row by row"
        )
    rows = [pose[start : start + _ROW] for start in range(0, _ROW**2, _ROW)]
    return {"transform_matrix": rows, "y_fov": camera.number("fov")}
