"""Initial positions of splats: at sparse points, in the visual hull, or at random in view.

What is at random in view lies in the volume that cameras have in common, and a share of it beyond:
surroundings that no splat begins at become fog before the cameras in short fits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rift_cl.errors import InputError
from rift_cl.geometry import Camera

# Constant spherical harmonic.
_Y0 = 0.28209479177387814
_OPACITY = 0.1
# A splat begins as large as the distance to so many neighbours.
_NEIGHBOURS = 3
# Share of the views that must see a random point, and how often points are drawn.
_SHARE_OF_VIEWS, _TRIES = 0.5, 400
# How far beyond the focus surroundings begin and end, in distances of the cameras from it.
_SURROUNDINGS = (1.2, 8.0)
# Share of the views that must see foreground at a point of the hull, share of points that lie near
# its surface, and how near, as a share of the distance at which the cameras stand.
_HULL, _SHELL, _DEPTH = 0.98, 0.85, 0.03
# Points that are tried to find out where the hull lies, and how many of them must lie in it.
_COARSE, _FEWEST = 200_000, 20

Floats = NDArray[np.float64]


def scene_extent(cameras: Sequence[Camera]) -> float:
    """The length that positions' rates are measured in: how far the cameras spread (3DGS)."""
    centers = np.array([camera.center for camera in cameras])
    spread = np.linalg.norm(centers - centers.mean(axis=0), axis=1).max()
    if spread > 0:
        return float(1.1 * spread)
    return float(np.linalg.norm(focus_of(cameras) - centers[0])) or 1.0


def focus_of(cameras: Sequence[Camera]) -> Floats:
    """The point nearest to all optical axes, (3,); before the cameras if they are parallel."""
    centers = np.array([camera.center for camera in cameras])
    axes = np.array([camera.view[2, :3] for camera in cameras])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    normal = across.sum(axis=0)
    if np.linalg.cond(normal) > 1e8:
        return np.asarray(centers.mean(axis=0) + axes.mean(axis=0))
    return np.asarray(np.linalg.solve(normal, (across @ centers[:, :, None]).sum(axis=0))[:, 0])


def field_diameter(cameras: Sequence[Camera]) -> float:
    """Width of the field of view at the focus: the size of a target that fills the images."""
    middle = focus_of(cameras)
    widths = []
    for camera in cameras:
        depth = abs(float(camera.view[2, :3] @ middle + camera.view[2, 3]))
        reach = 1.0 if camera.model == "ortho" else depth
        widths.append(max(camera.size) * reach / camera.intrinsics[0])
    return float(np.median(widths))


def random_points(cameras: Sequence[Camera], count: int, seed: int) -> Floats:
    """Points at random in the volume that at least half of the cameras see, (N, 3).

    Raises:
        InputError: the cameras have no volume in common.
    """
    random = np.random.default_rng((seed, 0x57A7))
    middle = focus_of(cameras)
    centers = np.array([camera.center for camera in cameras])
    reach = float(np.median(np.linalg.norm(centers - middle, axis=1))) or 1.0
    found: list[Floats] = []
    for _ in range(_TRIES):
        points = middle + random.uniform(-reach, reach, (count, 3))
        found.append(points[_seen_by(cameras, points) >= _SHARE_OF_VIEWS])
        if sum(map(len, found)) >= count:
            return np.concatenate(found)[:count]
    raise InputError(
        "the cameras have no volume in common that half of them see: give points to begin with"
    )


def far_points(cameras: Sequence[Camera], count: int, seed: int) -> Floats:
    """Points beyond the focus, each on a pixel of one camera, (N, 3); even in inverse distance.

    Args:
        cameras: with perspective; rays of fisheye lenses are taken as straight ones.
        count: how many points.
        seed: random seed.
    """
    random = np.random.default_rng((seed, 0xFA2))
    middle = focus_of(cameras)
    away = np.array([np.linalg.norm(camera.center - middle) for camera in cameras])
    first, last = (factor * (float(np.median(away)) or 1.0) for factor in _SURROUNDINGS)
    which = random.integers(len(cameras), size=count)
    depths = away[which] + 1 / random.uniform(1 / last, 1 / first, count)
    places = random.uniform(size=(count, 2))
    points = np.empty((count, 3))
    for number, camera in enumerate(cameras):
        mine = which == number
        fx, fy, cx, cy = camera.intrinsics
        pixels = places[mine] * (camera.width, camera.height)
        rays = np.column_stack([(pixels - (cx, cy)) / (fx, fy), np.ones(len(pixels))])
        points[mine] = (rays * depths[mine, None]) @ camera.view[:3, :3] + camera.center
    return points


def hull_points(
    cameras: Sequence[Camera], masks: Sequence[NDArray[np.bool_]], count: int, seed: int
) -> Floats | None:
    """Points in the visual hull: what all cameras see in front of the background, (N, 3).

    Most of them lie near its surface, where what is opaque shows.

    Args:
        cameras: some views, from as many sides as there are.
        masks: (height, width) the foreground of each.
        count: how many points.
        seed: random seed.

    Returns:
        The points, or None where hardly any point is in front of the background everywhere.
    """
    random = np.random.default_rng((seed, 0x40CC))
    middle = focus_of(cameras)
    centers = np.array([camera.center for camera in cameras])
    reach = float(np.median(np.linalg.norm(centers - middle, axis=1))) or 1.0
    coarse = middle + random.uniform(-reach, reach, (_COARSE, 3))
    coarse = coarse[_in_hull(cameras, masks, coarse)]
    if len(coarse) < _FEWEST:
        return None
    margin = 0.1 * (coarse.max(axis=0) - coarse.min(axis=0))
    low, high = coarse.min(axis=0) - margin, coarse.max(axis=0) + margin
    shell, core = [np.empty((0, 3))], [np.empty((0, 3))]
    for _ in range(_TRIES):
        points = random.uniform(low, high, (count, 3))
        points = points[_in_hull(cameras, masks, points)]
        away = random.normal(size=points.shape)
        away *= _DEPTH * reach / np.linalg.norm(away, axis=1, keepdims=True)
        near = ~_in_hull(cameras, masks, points + away)
        shell.append(points[near])
        core.append(points[~near])
        found, rest = sum(map(len, shell)), sum(map(len, core))
        if found >= _SHELL * count and found + rest >= count:
            outer = np.concatenate(shell)[: max(round(_SHELL * count), count - rest)]
            return np.concatenate([outer, np.concatenate(core)])[:count]
    return None


def _in_hull(
    cameras: Sequence[Camera], masks: Sequence[NDArray[np.bool_]], points: Floats
) -> NDArray[np.bool_]:
    seen, front = np.zeros(len(points)), np.zeros(len(points))
    for camera, mask in zip(cameras, masks, strict=True):
        rows, columns, inside = _pixels_of(camera, points)
        seen += inside
        front += inside & mask[rows, columns]
    return np.asarray((seen >= _SHARE_OF_VIEWS * len(cameras)) & (front >= _HULL * seen))


def _pixels_of(
    camera: Camera, points: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Rows and columns of the pixels that points fall on, and whether they fall on the image."""
    local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    with np.errstate(all="ignore"):
        depth = local[:, 2] if camera.model != "ortho" else 1.0
        u, v = fx * local[:, 0] / depth + cx, fy * local[:, 1] / depth + cy
        inside = (u > 0) & (u < camera.width) & (v > 0) & (v < camera.height)
    inside &= (local[:, 2] > 0) | (camera.model == "ortho")
    u, v = np.where(inside, u, 0), np.where(inside, v, 0)
    return v.astype(np.int64), u.astype(np.int64), inside


def _seen_by(cameras: Sequence[Camera], points: Floats) -> Floats:
    """Fraction of the cameras in whose image each point lies."""
    seen = sum(_pixels_of(camera, points)[2].astype(float) for camera in cameras)
    return np.asarray(seen / len(cameras))


def start_splats(
    points: Floats, colors: Floats | None = None, *, seed: int = 0
) -> dict[str, NDArray[np.float32]]:
    """Round, faint splats at (N, 3) points, as large as the gaps between them.

    Args:
        points: (N, 3) positions.
        colors: (N, 3) in display light, 0 to 1; random greys if not given.
        seed: random seed of those greys.

    Returns:
        Raw values with harmonics of degree 0, as ``Parameters.of`` takes them.

    Raises:
        InputError: there are no points.
    """
    count = len(points)
    if count == 0:
        raise InputError("there are no points to begin with, wanted one or more")
    random = np.random.default_rng((seed, 0xC0105))
    if colors is None:
        colors = random.uniform(0.3, 0.7, (count, 3))
    gaps = _gaps(points)
    values = {
        "means": points,
        "quats": np.tile([1.0, 0, 0, 0], (count, 1)),
        "log_scales": np.repeat(np.log(gaps)[:, None], 3, axis=1),
        "logits": np.full(count, np.log(_OPACITY / (1 - _OPACITY))),
        "sh": ((colors - 0.5) / _Y0)[:, None, :],
    }
    return {name: np.ascontiguousarray(value, np.float32) for name, value in values.items()}


def _gaps(points: Floats) -> Floats:
    """Root mean square distance to the nearest neighbours."""
    near = min(_NEIGHBOURS, len(points) - 1)
    if near == 0:
        return np.ones(1)
    distances = cKDTree(points).query(points, k=near + 1)[0][:, 1:]
    mean = np.sqrt((distances**2).mean(axis=1))
    least = max(float(np.median(mean)) * 1e-3, 1e-7)
    return np.asarray(np.maximum(mean, least))
