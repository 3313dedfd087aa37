"""A scene and the cameras that saw it, as the commands take them.

What the methods need is imported by them, so that a command's help loads no reader.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rift_cl.commands.inputs.opened_scene import OpenedScene
    from rift_cl.commands.inputs.scene_bounds import SceneBounds


@dataclass(frozen=True)
class OrbitInput(SceneInput):
    """The scene, how its splats are rendered, and the cameras of its capture."""

    capture: Auto[Path] = None
    """A capture of the same scene (its photographs need not be there), whose cameras set height,
    distance and up direction. Default: the cameras of the fit."""
    up: Auto[tuple[float, float, float]] = None
    """Up direction in the scene's coordinates. Default: that of the cameras, or estimated from the
    splats where there are none."""

    def bounds(self, scene: OpenedScene) -> SceneBounds:
        """Where the scene lies, and the cameras that saw it.

        Raises:
            RiftError: the capture cannot be read, its cameras are all in one place, or --up has no
                direction.
        """
        from rift_cl.commands.cameras.arc import check_places
        from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras, bounds_of_splats
        from rift_cl.io.captures.capture import open_capture

        bounds, own, up = bounds_of_splats(scene.splats), scene.cameras, self._direction_up()
        if self.capture is not None:
            capture = open_capture(self.capture, photographs=False)
            cameras = [view.camera for view in capture.views]
            check_places(cameras, self.capture)
            return bounds_of_cameras(cameras, bounds, capture.points, up=up)
        if own is not None:
            cameras, up = [view.camera for view in own.views], own.up if up is None else up
            return bounds_of_cameras(cameras, bounds, center=own.focus, up=up)
        return bounds if up is None else replace(bounds, up=up)

    def _direction_up(self) -> NDArray[np.float64] | None:
        """The unit vector (3,) that --up asks for, or None."""
        import numpy as np

        if self.up is None:
            return None
        length = math.hypot(*self.up)
        if not 0 < length < math.inf:
            raise InputError(f"--up is {' '.join(map(str, self.up))}, wanted a direction")
        return np.array(self.up) / length

    def notes(self, scene: OpenedScene) -> tuple[str, ...]:
        """What had to be assumed of the cameras, a sentence each."""
        known = scene.cameras is not None or self.capture is not None
        # The views of an X-ray scan are no photographs.
        if known or scene.splats.mode == "xray":
            return ()
        if scene.folder is None:
            return () if scene.fit is None else (self._without_fit(scene.fit),)
        return (
            f"{self.scene} holds no cameras, since an older version fitted it: the camera path and "
            "the up direction are estimated from the splats (name its capture with --capture).",
        )

    def _without_fit(self, fit: Path) -> str:
        return (
            f"{self.scene} is read without the fit that it lies in: camera path and up direction "
            "are estimated from the splats, background and eps2d are the defaults, and so are "
            "light and antialiasing where the file does not say them (name the folder instead: "
            f"{fit})."
        )
