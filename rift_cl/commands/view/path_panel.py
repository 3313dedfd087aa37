"""Key frames and their panel: a camera path is played, and exported for 'rift render --path'."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.commands.cameras.camera_path import smooth_path
from rift_cl.commands.view.lens_panel import LensPanel
from rift_cl.commands.view.markdown import markdown_of
from rift_cl.commands.view.pose import Pose
from rift_cl.commands.view.standpoint import Standpoint
from rift_cl.commands.view.viser_camera import go, pose_of
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import json_text


@dataclass(frozen=True)
class KeyFrame:
    """Where a page's camera was, and its lens; None for a pinhole."""

    pose: Pose
    aperture: Aperture | None = None

    def camera(self, aspect: float, edge: int) -> Camera:
        """The camera of a picture with this width by height, and so many pixels along an edge."""
        camera = dataclasses.replace(self.pose, aspect=aspect).camera(edge)
        return Camera(camera.size, camera.K, camera.view, camera.model, self.aperture)


def way_through(keys: Sequence[KeyFrame], between: int, edge: int) -> list[Camera]:
    """Cameras along a path.

    Args:
        keys: one or more; the first one's window gives the shape of all pictures.
        between: frames between each two of them.
        edge: longer edge of a picture in pixels.

    Raises:
        InputError: a pose makes no sense.
    """
    cameras = [key.camera(keys[0].pose.aspect, edge) for key in keys]
    return smooth_path(cameras, between)


def path_file(cameras: Sequence[Camera]) -> bytes:
    """The content of a transforms.json of these cameras."""
    names = [f"{number:04}.png" for number in range(len(cameras))]
    return json_text(transforms_of(cameras, names)).encode()


_RATE = 24.0
_BETWEEN, _MOST_BETWEEN, _MOST_KEYS = 23, 239, 200


class PathPanel:
    """Key frames, in the order in which they were added.

    Args:
        server: viser's.
        lens: of a key frame, and of what is played.
        size: gives the longer edge of an exported picture in pixels.
    """

    def __init__(self, server: Any, lens: LensPanel, size: Callable[[], int]) -> None:
        self._lens, self._size = lens, size
        self._keys, self._stop = list[KeyFrame](), threading.Event()
        self._player: Any = None
        with server.gui.add_folder("path", expand_by_default=False):
            gui = server.gui
            self._count = gui.add_markdown("")
            edit = gui.add_button_group("key frames", ("add", "remove last", "clear"))
            self._between = gui.add_slider(
                "between",
                min=0,
                max=_MOST_BETWEEN,
                step=1,
                initial_value=_BETWEEN,
                hint="frames between two key frames, of which there are 24 in a second",
            )
            run = gui.add_button_group("film", ("play", "stop", "export"))
        self._tell()

        async def on_edit(event: Any) -> None:
            if event.client is not None:
                self._edit(event.target.value, event.client)

        # Playing takes a while: a plain function runs on a thread of its own.
        def on_run(event: Any) -> None:
            if event.client is not None:
                self._run(event.target.value, event.client)

        edit.on_click(on_edit)
        run.on_click(on_run)

    def cameras(self) -> list[Camera]:
        """The path's cameras; none without key frames."""
        between = int(np.clip(self._between.value, 0, _MOST_BETWEEN))
        keys = list(self._keys)
        try:
            return way_through(keys, between, self._size()) if keys else []
        except InputError:
            return []

    def stop(self) -> None:
        """Play no further."""
        self._stop.set()

    def leave(self, client: Any) -> None:
        """Play no further for a page that is gone."""
        if client is self._player:
            self.stop()

    def _edit(self, what: str, client: Any) -> None:
        if what == "add":
            pose = pose_of(client.camera)
            if pose is not None and len(self._keys) < _MOST_KEYS:
                self._keys.append(KeyFrame(pose, self._lens.aperture))
        elif what == "clear":
            self._keys.clear()
        elif self._keys:
            self._keys.pop()
        self._tell()

    def _run(self, what: str, client: Any) -> None:
        self.stop()
        cameras = self.cameras()
        if what == "export" and cameras:
            client.send_file_download("path.json", path_file(cameras), save_immediately=True)
        elif what == "play":
            self._play(cameras, client)

    def _play(self, cameras: list[Camera], client: Any) -> None:
        """Play the camera path on a page."""
        self._stop = stopped = threading.Event()
        self._player = client
        reach = float(np.linalg.norm(client.camera.look_at - client.camera.position)) or 1.0
        for camera in cameras:
            _, down, forward = camera.view[:3, :3]
            fov = 2 * np.arctan(camera.height / 2 / camera.intrinsics[1])
            target = camera.center + reach * forward
            if camera.aperture != self._lens.aperture:
                self._lens.take(camera.aperture)
            go(client, Standpoint(camera.center, target, -down, float(fov)))
            if stopped.wait(1 / _RATE):
                break

    def _tell(self) -> None:
        count = len(self._keys)
        self._count.content = markdown_of(
            f"{count} key frames; 'rift render --path path.json' draws what is exported"
        )
