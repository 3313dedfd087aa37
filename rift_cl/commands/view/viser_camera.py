"""A page's camera, read from viser and told to it."""

from __future__ import annotations

from typing import Any

from rift_cl.commands.view.pose import Pose
from rift_cl.commands.view.standpoint import Standpoint
from rift_cl.errors import InputError
from rift_cl.geometry import Camera


def pose_of(camera: Any) -> Pose | None:
    """Where a page says that its camera is; None where it says nonsense."""
    size = camera.image_height, camera.image_width
    try:
        return Pose.said(camera.wxyz, camera.position, camera.fov, *size)
    except InputError:
        return None


def go(client: Any, there: Standpoint) -> None:
    """Move the camera of a page."""
    camera = client.camera
    with client.atomic():
        # viser takes the target along with the position, and the turn from up and target.
        camera.position = there.position
        camera.up_direction = there.up
        camera.look_at = there.target
        camera.fov = there.fov
    client.flush()


def wxyz_of(camera: Camera) -> tuple[float, ...]:
    """A camera's camera-to-world rotation as viser takes it."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(camera.view[:3, :3].T).as_quat().tolist()
    return w, x, y, z
