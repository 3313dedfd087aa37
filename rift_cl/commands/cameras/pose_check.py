"""Whether poses are those of the scene: checked before hours are spent on ones that are not.

Poses with other axes than a file's should have, or from world to camera where the other way is
meant, let cameras look away from the sparse points that were found by the same program. Coordinates
far from the origin, as surveys have them, leave float32 too few digits for what lies between them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.train.start.points import pixels_of, scene_size

Floats = NDArray[np.float64]

# Cameras and points that are looked at.
_CAMERAS, _POINTS = 64, 200_000
# Share of the points that lies in a picture, in the median, from which poses are believed, and that
# other poses must reach to be named. Each picture of a survey shows a small share, but some.
_FEWEST, _MANY = 0.02, 0.2
# Turns the axes of OpenGL's cameras into those of OpenCV's, and back.
_TURN = np.diag([1.0, -1.0, -1.0, 1.0])
_OTHER_AXES = (
    "the poses fit if the axes of their cameras are turned: they are OpenCV's (x right, y down, z "
    "forward) where OpenGL's (x right, y up, z back) are expected, or the other way round"
)
_OTHER_WAY = (
    "the poses fit if they are inverted: they lead from world to camera where camera to world is "
    "expected, or the other way round"
)
# Rounding of float32 that a scene survives, as a share of its size.
_ROUNDING = 2e-4


def check_poses(cameras: Sequence[Camera], points: NDArray[np.float32] | None, where: Path) -> None:
    """Check that cameras look at the sparse points, and that float32 tells places apart.

    Args:
        cameras: of the photographs.
        points: (P, 3) sparse points; None where there are none.
        where: named in errors.

    Raises:
        InputError: they do not.
    """
    _check_offset(cameras, where)
    check_sight(cameras, points, where)


def check_sight(cameras: Sequence[Camera], points: NDArray[np.float32] | None, where: Path) -> None:
    """Check that cameras look at the sparse points that came with them.

    Of cameras that a scene is drawn from the digits of places do not matter, since the scene has
    its own. Arguments and errors are those of ``check_poses``.
    """
    if points is None or not len(points):
        return
    few = [cameras[number] for number in evenly(len(cameras), _CAMERAS)]
    some = np.asarray(points[evenly(len(points), _POINTS)], np.float64)
    share = _seen(few, some)
    if share >= _FEWEST:
        return
    fitting = (words for words, others in _other_poses(few) if _seen(others, some) >= _MANY)
    reason = next(fitting, "")
    if share and not reason:
        return
    raise InputError(
        f"{where}: half of the photographs show at most {100 * share:.1f} % of the sparse points: "
        + (reason or "check the poses, the intrinsics, and that the points belong to them")
    )


def unseen_notes(unseen: int, views: int) -> list[str]:
    """A sentence about views that show nothing of a scene.

    Args:
        unseen: how many have no splat in sight.
        views: how many there are.
    """
    if not unseen:
        return []
    return [
        f"no splat is in sight of {unseen} of {views} views: check that poses and intrinsics are "
        "those of this scene, in its frame and its unit"
    ]


def _check_offset(cameras: Sequence[Camera], where: Path) -> None:
    centers = np.array([camera.center for camera in cameras])
    size = scene_size(cameras)
    step = float(np.spacing(np.float32(np.abs(centers).max())))
    if step <= _ROUNDING * size:
        return
    middle = ", ".join(f"{value:.0f}" for value in centers.mean(axis=0))
    raise InputError(
        f"{where}: the cameras stand up to {np.abs(centers).max():.3g} from the origin, where "
        f"float32 has steps of {step:.2g}, too coarse for a scene of about {size:.3g}: subtract "
        f"({middle}) from all positions and points"
    )


def _seen(cameras: Sequence[Camera], points: Floats) -> float:
    """The share of the points within each picture, of all pictures the median."""
    shares = []
    for camera in cameras:
        if camera.model == "fisheye":
            # Pictures of such lenses may reach round by half a turn.
            inside = points @ camera.view[2, :3] + camera.view[2, 3] > 0
        else:
            inside = pixels_of(camera, points)[2]
        shares.append(inside.mean())
    return float(np.median(shares))


def _other_poses(cameras: Sequence[Camera]) -> Iterator[tuple[str, list[Camera]]]:
    """What poses may have been meant as, in words, and the cameras that they then are."""
    turned = [replace(camera, view=_TURN @ camera.view) for camera in cameras]
    yield _OTHER_AXES, turned
    for before, after in ((np.eye(4), np.eye(4)), (np.eye(4), _TURN), (_TURN, _TURN)):
        inverted = [before @ np.linalg.inv(camera.view) @ after for camera in cameras]
        yield (
            _OTHER_WAY,
            [replace(c, view=view) for c, view in zip(cameras, inverted, strict=True)],
        )
