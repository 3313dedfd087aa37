"""Where the splats of a fit begin: at the capture's points, in the visual hull, or at random."""

from __future__ import annotations

from typing import Any

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.io.captures.capture import Capture
from rift_cl.train.parameters import Parameters
from rift_cl.train.start.points import far_points, hull_points, random_points, start_splats

# Fewer sparse points tell nothing of where a scene is.
_FEWEST = 20
# A fit begins with no more random splats than this share of all it may have.
_FIRST_SHARE = 0.5
# Share of these beyond what the cameras have in common.
_FAR_SHARE = 0.2
# Photographs that carve the visual hull.
_HULL_VIEWS = 50


def first_splats(
    device: Device,
    capture: Capture,
    pictures: CapturePictures,
    *,
    count: int,
    guessed: int,
    seed: int,
) -> Parameters:
    """At most ``count`` splats at the capture's points, or ``guessed`` if it has next to none."""
    points, colors = capture.points, capture.point_colors
    if points is None or len(points) < _FEWEST:
        points, colors = _guessed(pictures, guessed, seed), None
    elif len(points) > count:
        random = np.random.default_rng((seed, 0x901))
        kept = np.sort(random.choice(len(points), count, replace=False))
        points, colors = points[kept], None if colors is None else colors[kept]
    raw = start_splats(
        np.asarray(points, float),
        None if colors is None else np.asarray(colors, float),
        seed=seed,
    )
    return Parameters.of(device, raw)


def start_notes(capture: Capture) -> list[str]:
    """A sentence about sparse points that are too few to begin at."""
    points = capture.points
    if points is None or not 0 < len(points) < _FEWEST:
        return []
    return [
        f"{len(points)} sparse points are too few to begin at: splats begin as without them (from "
        f"{_FEWEST} points on they begin there)"
    ]


def _guessed(pictures: CapturePictures, count: int, seed: int) -> Any:
    """Points in the visual hull, or about the focus and beyond it if there is no background."""
    views = len(pictures.cameras)
    few = evenly(views, _HULL_VIEWS)
    fronts = [pictures.foreground(number) for number in few]
    masks = [front for front in fronts if front is not None]
    if len(masks) == len(few):
        cameras = [pictures.cameras[number] for number in few]
        counted = [pictures.counted(number) for number in few]
        points = hull_points(cameras, masks, count, seed, counted=counted)
        if points is not None:
            return points
    first = max(1, int(count * _FIRST_SHARE))
    perspective = all(camera.model != "ortho" for camera in pictures.cameras)
    far = int(first * _FAR_SHARE) if perspective else 0
    near = random_points(pictures.cameras, first - far, seed)
    return np.concatenate([near, far_points(pictures.cameras, far, seed)])
