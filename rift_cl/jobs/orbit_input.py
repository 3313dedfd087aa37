"""A scene and what a camera turns about in it, as the commands take them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rift_cl.errors import InputError
from rift_cl.io.capture import open_capture
from rift_cl.io.splat_scene import SplatScene
from rift_cl.jobs.scene_bounds import SceneBounds, bounds_of_cameras, bounds_of_splats
from rift_cl.jobs.scene_input import SceneInput


@dataclass(frozen=True)
class OrbitInput(SceneInput):
    """Where a scene is, what a camera turns about, and which way is up."""

    capture: Path | None = None
    """A capture of the same scene: turn where its cameras looked, upright and as far off as they
    are."""
    up: tuple[float, float, float] | None = None
    """Which way is up; from --capture, or from the scene's shape, when not given."""

    def bounds(self, scene: SplatScene) -> SceneBounds:
        """Where the scene lies.

        Raises:
            RiftError: the capture cannot be read, or --up has no direction.
        """
        bounds = bounds_of_splats(scene)
        if self.capture is not None:
            views = open_capture(self.capture).views
            bounds = bounds_of_cameras([view.camera for view in views], bounds)
        if self.up is None:
            return bounds
        length = float(np.linalg.norm(self.up))
        if not 0 < length < math.inf:
            raise InputError(f"--up is {' '.join(map(str, self.up))}, wanted a direction")
        return replace(bounds, up=np.array(self.up) / length)
