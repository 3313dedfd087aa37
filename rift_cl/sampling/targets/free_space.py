"""Occupancy from depth maps: free space, behind surfaces, or not observed.

Each picture with a map of depth says of every point before it whether it is free (nearer than what
shows there) or behind a surface. A point is free if some pictures look through it, and behind if it
is not free and a picture has a surface before it. Of what no picture holds, the border of the
pictures says something: a wall that reaches the border goes on beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.geometry.numbers import real_numbers

Floats = NDArray[np.float64]
FREE, UNSEEN, BEHIND = 0, 1, 2
# Share of a depth by which it may be wrong, in a picture and where its border is taken to go on;
# and share of the pictures that must look through free space.
_WRONG, _OUTSIDE, _LEAST = 0.03, 0.1, 0.1
# Beyond this tangent from the axis the border of a picture says nothing (75 degrees).
_WIDE = 3.7
# Samples of a line of sight, and how far from the target's middle lines end, in its radius.
_STEPS, _OUT = 24, 0.7
# Sparse points in a cell of their map, the nearest of which counts (a quantile, against strays),
# and how many cells a gap may be wide.
_IN_CELL, _NEAREST, _GAP = 4, 0.25, 2.0


@dataclass(frozen=True, eq=False)
class DepthMap:
    """Depth map of one view.

    Args:
        camera: the view; its size may be another than that of the map.
        depth: (rows, columns) along the camera's axis; inf where nothing shows, NaN where it is
            not known.

    Raises:
        ShapeError: the depth is no picture.
        InputError: a depth is not above zero, or the camera is no pinhole.
    """

    camera: Camera
    depth: Floats

    def __post_init__(self) -> None:
        """Check the arguments."""
        depth = np.asarray(self.depth, np.float64)
        if depth.ndim != 2 or not depth.size:
            raise ShapeError(f"DepthMap: depth has shape {depth.shape}, wanted (rows, columns)")
        if (depth <= 0).any():
            raise InputError("DepthMap: depth holds zero or less, wanted distances along the axis")
        if self.camera.model != "pinhole":
            raise InputError(f"DepthMap: the camera is {self.camera.model}, wanted a pinhole")
        object.__setattr__(self, "depth", depth)


class FreeSpace:
    """Which space pictures show to be free.

    Args:
        maps: depths, of one picture or more.

    Raises:
        InputError: there is none.
    """

    def __init__(self, maps: Sequence[DepthMap]) -> None:
        if not maps:
            raise InputError("FreeSpace: there is no map of depth, wanted one or more")
        self.maps = tuple(maps)

    def judged(self, points: ArrayLike) -> NDArray[np.int8]:
        """(n,) ``FREE``, ``UNSEEN`` or ``BEHIND`` for points (n, 3).

        What lies on a surface, or in what shows, is ``BEHIND`` as well.
        """
        x = real_numbers(points)
        if x is None or x.ndim != 2 or x.shape[1] != 3:
            raise ShapeError(f"FreeSpace: points has shape {np.shape(points)}, wanted (n, 3)")
        # Rows: in a picture, beyond its border; columns: free, behind.
        votes = np.zeros((2, 2, len(x)))
        for one in self.maps:
            inside, told, free = _seen_by(one, x)
            for row, held in enumerate((inside, ~inside)):
                votes[row, 0] += told & held & free
                votes[row, 1] += told & held & ~free
        (free_in, behind_in), (free_out, behind_out) = votes
        looked = free_in + behind_in
        found = np.where(behind_out > free_out, BEHIND, UNSEEN)
        found = np.where(looked > 0, BEHIND, found)
        return np.where((free_in > 0) & (free_in >= _LEAST * looked), FREE, found).astype(np.int8)

    def in_sight(self, places: ArrayLike, center: ArrayLike, radius: float) -> Floats:
        """(n,) visible fraction of a ball's outline from each position; 0 where no camera fits.

        A line of sight is clear if no part of it outside the ball lies behind a surface: what shows
        within the ball is the target itself.

        Args:
            places: (n, 3) of the cameras.
            center: (3,) of the ball.
            radius: of the ball.
        """
        x, middle = np.asarray(places, np.float64), np.asarray(center, np.float64)
        away = x - middle
        distance = np.linalg.norm(away, axis=1)
        unit = away / np.maximum(distance, 1e-300)[:, None]
        first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit), axis=1)])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(unit, first)
        turns = 2 * np.pi * np.arange(6) / 6
        clear = np.zeros((7, len(x)), bool)
        for line in range(7):
            end = np.broadcast_to(middle, x.shape)
            if line:
                across = np.cos(turns[line - 1]) * first + np.sin(turns[line - 1]) * second
                end = middle + _OUT * radius * across
            # Up to where the line enters the ball, whose outline is seen about square on.
            reach = np.maximum(1 - radius / np.maximum(distance, radius), 0)
            share = np.linspace(0, 1, _STEPS)[:, None] * reach
            samples = x + share[..., None] * (end - x)
            state = self.judged(samples.reshape(-1, 3)).reshape(share.shape)
            clear[line] = (state != BEHIND).all(axis=0)
        # A camera cannot stand where something is, whatever the lines say.
        return np.asarray(np.where(self.judged(x) == BEHIND, 0, clear.mean(axis=0)))

    def scaled(self, factor: float) -> FreeSpace:
        """A copy with all lengths multiplied by a factor."""
        return FreeSpace([_scaled(one, factor) for one in self.maps])


def depth_of_points(camera: Camera, points: ArrayLike) -> DepthMap | None:
    """A coarse map from sparse points; None where fewer than a handful are in the picture.

    Gaps are filled from cells nearby; beyond, nothing is known.

    Args:
        camera: a pinhole.
        points: (P, 3) in world coordinates.
    """
    from scipy.ndimage import distance_transform_edt

    x = np.asarray(points, np.float64)
    local = x @ camera.view[:3, :3].T + camera.view[:3, 3]
    local = local[local[:, 2] > 0]
    fx, fy, cx, cy = camera.intrinsics
    u, v = fx * local[:, 0] / local[:, 2] + cx, fy * local[:, 1] / local[:, 2] + cy
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    count = int(inside.sum())
    if count < _IN_CELL:
        return None
    edge = np.sqrt(camera.width * camera.height * _IN_CELL / count)
    shape = (max(1, round(camera.height / edge)), max(1, round(camera.width / edge)))
    row = (v[inside] / camera.height * shape[0]).astype(int)
    column = (u[inside] / camera.width * shape[1]).astype(int)
    cell, depth = row * shape[1] + column, local[inside, 2]
    order = np.lexsort((depth, cell))
    cells, begin, number = np.unique(cell[order], return_index=True, return_counts=True)
    flat = np.full(shape[0] * shape[1], np.nan)
    flat[cells] = depth[order][begin + (_NEAREST * (number - 1)).astype(int)]
    known = flat.reshape(shape)
    gap, near = distance_transform_edt(np.isnan(known), return_indices=True)
    return DepthMap(camera, np.where(gap <= _GAP, known[tuple(near)], np.nan))


def _seen_by(
    one: DepthMap, points: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether points are in a picture, whether it tells anything of them, whether they are free."""
    camera, (rows, columns) = one.camera, one.depth.shape
    local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    depth = local[:, 2]
    ahead = depth > 0
    fx, fy, cx, cy = camera.intrinsics
    x, y = (local[:, axis] / np.where(ahead, depth, 1) for axis in (0, 1))
    u, v = (fx * x + cx) / camera.width, (fy * y + cy) / camera.height
    inside = ahead & (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    near = ahead & (np.hypot(x, y) < _WIDE)
    # Far outside, the border is the nearest that is known.
    row = np.clip(np.floor(np.clip(v, 0, 1) * rows), 0, rows - 1).astype(int)
    column = np.clip(np.floor(np.clip(u, 0, 1) * columns), 0, columns - 1).astype(int)
    shown = one.depth[row, column]
    told = near & ~np.isnan(shown)
    return inside, told, depth < np.where(inside, 1 - _WRONG, 1 - _OUTSIDE) * shown


def _scaled(one: DepthMap, factor: float) -> DepthMap:
    camera, view = one.camera, one.camera.view.copy()
    view[:3, 3] *= factor
    return DepthMap(Camera(camera.size, camera.K, view, camera.model), one.depth * factor)
