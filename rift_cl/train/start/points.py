"""Initial positions of splats: at sparse points, in the visual hull, or at random in view.

What is at random in view lies in the volume that cameras have in common, and a share of it beyond:
surroundings that no splat begins at become fog before the cameras in short fits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rift_cl.cl.host_arrays import check_finite
from rift_cl.errors import InputError
from rift_cl.geometry import Camera

# Constant spherical harmonic.
_Y0 = 0.28209479177387814
_OPACITY = 0.1
# A splat begins as large as the distance to so many neighbours.
_NEIGHBOURS = 3
# Condition number of axes that are parallel to rounding, and the root mean square angle, in
# degrees, up to which axes that do not meet count as such.
_PARALLEL, _NEARLY = 1e8, 2.0
# Root mean square angle by which axes miss a point where they meet, as a share of the spread of
# directions.
_MISSED = 0.6
# Step from one camera to the next where they look side by side, as a share of what a picture shows.
_STEP = 0.25
# Depths at which random points begin before cameras that look side by side and have no volume in
# common, as shares of that depth.
_BESIDE = (0.5, 2.0)
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


def scene_size(cameras: Sequence[Camera]) -> float:
    """The length that scales and depths are measured in.

    It is the median distance of the cameras from their focus, or how far they spread where that is
    more, as of cameras that look outward. No unit of a scene's coordinates changes a fit then.
    """
    away = np.linalg.norm([camera.center for camera in cameras] - focus_of(cameras), axis=1)
    return max(float(np.median(away)), scene_extent(cameras))


def focus_of(cameras: Sequence[Camera]) -> Floats:
    """The point nearest to all optical axes, (3,).

    Cameras that look side by side have none that means anything: it is then before their middle, as
    far as pictures of neighbours share most of what they show.
    """
    nearest = _nearest_to_axes(cameras)
    if nearest is not None:
        return nearest
    centers = np.array([camera.center for camera in cameras])
    axes = np.array([camera.view[2, :3] for camera in cameras])
    return np.asarray(centers.mean(axis=0) + _overlap_depth(cameras, centers) * axes.mean(axis=0))


def _nearest_to_axes(cameras: Sequence[Camera]) -> Floats | None:
    """The point nearest to all axes; None of axes that are parallel, or nearly, and do not meet."""
    centers = np.array([camera.center for camera in cameras])
    axes = np.array([camera.view[2, :3] for camera in cameras])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    normal = across.sum(axis=0)
    if np.linalg.cond(normal) > _PARALLEL:
        return None
    focus = np.linalg.solve(normal, (across @ centers[:, :, None]).sum(axis=0))[:, 0]
    # Its smallest eigenvalue is the sum of the axes' squared angles to the direction in common.
    turned = np.linalg.eigvalsh(normal)[0] > len(cameras) * np.radians(_NEARLY) ** 2
    return np.asarray(focus) if turned or axes_meet(cameras, focus) else None


def _perspective(cameras: Sequence[Camera]) -> bool:
    return all(camera.model != "ortho" for camera in cameras)


def axes_meet(cameras: Sequence[Camera], focus: Floats) -> bool:
    """Whether the axes of cameras meet near a point, in front of them.

    They do if their axes turn with the directions in which they see it: if they miss it by angles
    that are small beside the spread of those directions.
    """
    ways = focus - np.array([camera.center for camera in cameras])
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300)
    axes = np.array([camera.view[2, :3] for camera in cameras])
    mean = ways.mean(axis=0) / (np.linalg.norm(ways.mean(axis=0)) or 1.0)
    # One less the cosine is half the square of a small angle.
    missed, spread = np.mean(1 - (ways * axes).sum(axis=1)), np.mean(1 - ways @ mean)
    return bool(missed < _MISSED**2 * spread)


def _overlap_depth(cameras: Sequence[Camera], centers: Floats) -> float:
    """The depth at which pictures of neighbours, side by side, share most of what they show."""
    if len(cameras) < 2:
        return 1.0
    spacing = float(np.median(cKDTree(centers).query(centers, k=2)[0][:, 1]))
    widths = [min(camera.size) / camera.intrinsics[0] for camera in cameras]
    return spacing / (_STEP * float(np.median(widths))) or 1.0


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

    Of cameras side by side, as of a survey, that have no such volume, on rays of each.

    Raises:
        InputError: the cameras look elsewhere, or have no volume in common.
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
    if _nearest_to_axes(cameras) is None and _perspective(cameras):
        which = random.integers(len(cameras), size=count)
        depth = reach if len(cameras) == 1 else _overlap_depth(cameras, centers)
        return _on_rays(cameras, which, depth * random.uniform(*_BESIDE, count), random)
    depths = [camera.view[2, :3] @ middle + camera.view[2, 3] for camera in cameras]
    if np.mean(np.array(depths) > 0) < _SHARE_OF_VIEWS:
        raise InputError(
            "most cameras have the place where their axes meet behind them: poses are probably "
            "given with other axes (OpenCV's for OpenGL's, or the other way round), or from world "
            "to camera; cameras that do look outward want points to begin with"
        )
    raise InputError(
        "there is no volume that half of the cameras see: check poses and intrinsics, or give "
        "points to begin with"
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
    return _on_rays(cameras, which, depths, random)


def _on_rays(
    cameras: Sequence[Camera],
    which: NDArray[np.int64],
    depths: Floats,
    random: np.random.Generator,
) -> Floats:
    """Points at depths on random pixels of some of the cameras, (N, 3)."""
    places = random.uniform(size=(len(which), 2))
    points = np.empty((len(which), 3))
    for number, camera in enumerate(cameras):
        mine = which == number
        fx, fy, cx, cy = camera.intrinsics
        pixels = places[mine] * (camera.width, camera.height)
        rays = np.column_stack([(pixels - (cx, cy)) / (fx, fy), np.ones(len(pixels))])
        points[mine] = (rays * depths[mine, None]) @ camera.view[:3, :3] + camera.center
    return points


def hull_points(
    cameras: Sequence[Camera],
    masks: Sequence[NDArray[np.bool_]],
    count: int,
    seed: int,
    *,
    counted: Sequence[NDArray[np.bool_] | None] | None = None,
) -> Floats | None:
    """Points in the visual hull: what all cameras see in front of the background, (N, 3).

    Most of them lie near its surface, where what is opaque shows.

    Args:
        cameras: some views, from as many sides as there are.
        masks: (height, width) the foreground of each.
        count: how many points.
        seed: random seed.
        counted: (height, width) the pixels of each that are known; None for all. A point that
            falls on another is not seen by that camera, and is neither carved nor kept by it.

    Returns:
        The points, or None where hardly any point is in front of the background everywhere.
    """
    random = np.random.default_rng((seed, 0x40CC))
    seen_by = [None] * len(cameras) if counted is None else counted
    views = list(zip(cameras, masks, seen_by, strict=True))
    middle = focus_of(cameras)
    centers = np.array([camera.center for camera in cameras])
    reach = float(np.median(np.linalg.norm(centers - middle, axis=1))) or 1.0
    coarse = middle + random.uniform(-reach, reach, (_COARSE, 3))
    coarse = coarse[_in_hull(views, coarse)]
    if len(coarse) < _FEWEST:
        return None
    margin = 0.1 * (coarse.max(axis=0) - coarse.min(axis=0))
    low, high = coarse.min(axis=0) - margin, coarse.max(axis=0) + margin
    shell, core = [np.empty((0, 3))], [np.empty((0, 3))]
    for _ in range(_TRIES):
        points = random.uniform(low, high, (count, 3))
        points = points[_in_hull(views, points)]
        away = random.normal(size=points.shape)
        away *= _DEPTH * reach / np.linalg.norm(away, axis=1, keepdims=True)
        near = ~_in_hull(views, points + away)
        shell.append(points[near])
        core.append(points[~near])
        found, rest = sum(map(len, shell)), sum(map(len, core))
        if found >= _SHELL * count and found + rest >= count:
            outer = np.concatenate(shell)[: max(round(_SHELL * count), count - rest)]
            return np.concatenate([outer, np.concatenate(core)])[:count]
    return None


def _in_hull(
    views: Sequence[tuple[Camera, NDArray[np.bool_], NDArray[np.bool_] | None]], points: Floats
) -> NDArray[np.bool_]:
    seen, front = np.zeros(len(points)), np.zeros(len(points))
    for camera, mask, counted in views:
        rows, columns, inside = pixels_of(camera, points)
        if counted is not None:
            inside = inside & counted[rows, columns]
        seen += inside
        front += inside & mask[rows, columns]
    return np.asarray((seen >= _SHARE_OF_VIEWS * len(views)) & (front >= _HULL * seen))


def pixels_of(
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
    seen = sum(pixels_of(camera, points)[2].astype(float) for camera in cameras)
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
        NonFiniteError: a point or a colour holds NaN or infinity.
    """
    count = len(points)
    if count == 0:
        raise InputError("there are no points to begin with, wanted one or more")
    check_finite(np.asarray(points), name="points")
    if colors is not None:
        check_finite(np.asarray(colors), name="colors")
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
