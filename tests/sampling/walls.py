"""Cameras before a wall, and what they see of it: for tests of what stands in the way."""

from __future__ import annotations

import numpy as np

from rift_cl.geometry import Camera

# The wall is the plane x = -WALL behind the target at the origin, seen from the side of x > 0.
WALL = 0.8


def looking(place, at=(0, 0, 0), size=(60, 60), focal=60.0):
    """A camera at a place that looks at a point, z up."""
    place, at = np.asarray(place, float), np.asarray(at, float)
    forward = (at - place) / np.linalg.norm(at - place)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = [right, np.cross(forward, right), forward]
    view[:3, 3] = -view[:3, :3] @ place
    K = [[focal, 0, size[1] / 2], [0, focal, size[0] / 2], [0, 0, 1]]
    return Camera(size, K, view)


def arc(count=9, reach=50.0, radius=4.0, height=1.0):
    """Cameras on an arc before the wall, ``reach`` degrees to either side."""
    turns = np.radians(np.linspace(-reach, reach, count))
    return [looking((radius * np.cos(t), radius * np.sin(t), height)) for t in turns]


def points_before_a_wall(count=3000):
    """Sparse points of the wall, and of a ball of radius 0.5 before it."""
    draw = np.random.default_rng(0)
    wall = np.column_stack([np.full(count, -WALL), *draw.uniform(-2.5, 2.5, (2, count))])
    ball = draw.normal(size=(count // 3, 3))
    ball *= 0.5 / np.linalg.norm(ball, axis=1, keepdims=True)
    return np.concatenate([wall, ball[ball[:, 0] > 0]])


def depth_of_ball(camera, radius=0.5, behind=np.inf):
    """Depth of a ball at the origin, and of nothing, or of the wall, behind it."""
    rows, columns = np.indices(camera.size) + 0.5
    fx, fy, cx, cy = camera.intrinsics
    rays = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones(camera.size)], -1)
    middle = camera.view[:3, 3]
    a, b, c = (rays**2).sum(-1), rays @ middle, middle @ middle - radius**2
    root = b**2 - a * c
    hit = (b - np.sqrt(np.maximum(root, 0))) / a
    if behind is None:
        world = rays @ camera.view[:3, :3]
        behind = (-WALL - camera.center[0]) / np.minimum(world[..., 0], -1e-9)
    return np.where(root > 0, hit, behind)
