"""Bounds of a scene: centre of orbits, extent, and up direction.

Splats that float far off, or faint ones, must not pull the middle away: everything is a median or
a percentile, weighted by opacity. Splats alone do not say which way is up; cameras do, since people
hold them upright.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.cameras.focus import focus_among
from rift_cl.geometry import Camera
from rift_cl.io.scenes.splat_activations import opacities_of
from rift_cl.io.scenes.splat_scene import SplatScene

Floats = NDArray[np.float64]

# Share of the opacity that lies within the radius.
_INSIDE = 0.9
# A scene is flat if it is so much thinner than it is wide; its thin axis is then up or down.
_FLAT = 0.6
# What most files call up: z, or in COLMAP's camera-like axes, -y.
_USUAL = np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]])
# Cameras that look every way have no common up, which their mean shows by its length.
_UPRIGHT = 0.2
# Mean square of the second most horizontal direction, from which on there are two; and the cosine
# of how far from the mean up may lie (60 degrees).
_SPREAD, _NEAR_MEAN = 0.01, 0.5


@dataclass(frozen=True, eq=False)
class SceneBounds:
    """The ball that a scene fills.

    Args:
        center: (3,) its middle.
        radius: of the ball, in scene units.
        up: (3,) unit vector.
        distance: at which the cameras stood, or None.
        elevation: above the horizon at which they stood, in degrees, or None.
        cameras: those cameras; empty where nobody knows them.
    """

    center: Floats
    radius: float
    up: Floats
    distance: float | None = None
    elevation: float | None = None
    cameras: tuple[Camera, ...] = ()


def bounds_of_splats(scene: SplatScene) -> SceneBounds:
    """The ball that holds nine tenths of the opacity; up is the axis along which it is flat.

    A scene that is flat along none has z up. The thin axis points as files usually have it: to z,
    or else to -y, or else to x.
    """
    means = scene.means.astype(np.float64)
    weights = opacities_of(scene.logit_opacities).astype(np.float64)
    if weights.sum() <= 0:
        weights = np.ones(len(means))
    center = np.array([weighted_quantile(means[:, k], weights, 0.5) for k in range(3)])
    away = np.linalg.norm(means - center, axis=1)
    radius = weighted_quantile(away, weights, _INSIDE)
    if radius <= 0:
        # One splat, or several in one place: as large as it is itself.
        radius = 3 * float(np.exp(np.median(scene.log_scales.max(axis=1))))
    return SceneBounds(center, radius, _thin_axis(means - center, weights * (away <= radius)))


def bounds_of_cameras(
    cameras: Sequence[Camera],
    splats: SceneBounds | None = None,
    points: NDArray[np.float32] | None = None,
    *,
    center: Floats | None = None,
    up: Floats | None = None,
) -> SceneBounds:
    """Focus, distance and common up direction of cameras.

    Args:
        cameras: of the capture that the splats were fitted to.
        splats: where the splats lie: their radius, and their up where cameras have none.
        points: (P, 3) sparse points of the scene, or None.
        center: (3,) what they look at; found from their axes and the points if not given.
        up: (3,) unit vector; theirs in common if not given.
    """
    center = focus_among(cameras, points) if center is None else center
    ways = np.array([camera.center for camera in cameras]) - center
    up = common_up(cameras) if up is None else up
    if up is None:
        up = _upward() if splats is None else splats.up
    distances = np.linalg.norm(ways, axis=1)
    distance = float(np.median(distances))
    radius = distance / 2 if splats is None else splats.radius
    if distance <= 0:
        return SceneBounds(center, radius or 1.0, up, cameras=tuple(cameras))
    rise = np.clip(ways @ up / np.where(distances > 0, distances, 1), -1, 1)
    elevation = float(np.degrees(np.median(np.arcsin(rise))))
    return SceneBounds(center, radius, up, distance, elevation, tuple(cameras))


def common_up(cameras: Sequence[Camera]) -> Floats | None:
    """The direction (3,) that cameras have above, or None where they have none in common.

    Cameras that look down from one side all lean the same way, and so does the mean of what their
    pictures have above. But pictures of upright cameras have the horizon from left to right: up is
    across those directions, if they are not all alike.
    """
    mean = -np.mean([camera.view[1, :3] for camera in cameras], axis=0)
    length = float(np.linalg.norm(mean))
    if not length > _UPRIGHT:
        return None
    sideways = np.array([camera.view[0, :3] for camera in cameras])
    spread, axes = np.linalg.eigh(sideways.T @ sideways / len(cameras))
    across = np.asarray(axes[:, 0] * np.sign(axes[:, 0] @ mean), np.float64)
    if spread[1] > _SPREAD and across @ mean > _NEAR_MEAN * length:
        return across
    return np.asarray(mean / length)


def weighted_quantile(values: Floats, weights: Floats, share: float) -> float:
    """The least value below or at which so large a share of the weight lies."""
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    place = int(np.searchsorted(sums, share * sums[-1]))
    return float(values[order][min(place, len(values) - 1)])


def _thin_axis(offsets: Floats, weights: Floats) -> Floats:
    """The axis of least spread if it is much less than the others', else z."""
    if np.count_nonzero(weights) < 4:
        return _upward()
    spread, axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets / weights.sum())
    if not np.sqrt(max(spread[0], 0)) < _FLAT * np.sqrt(max(spread[1], 0)):
        return _upward()
    thin = axes[:, 0]
    nearest = int(np.abs(_USUAL @ thin).argmax())
    return np.asarray(thin * np.sign(_USUAL[nearest] @ thin), np.float64)


def _upward() -> Floats:
    return np.asarray(_USUAL[0], np.float64)
