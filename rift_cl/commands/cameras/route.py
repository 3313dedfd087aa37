"""A smooth camera path from one end of a capture to the other, close to its cameras.

The cameras are the knots of a graph; the route is the one between the two that lie farthest apart
in it whose hops have the least sum of squares, so that many short hops are preferred to a long one.
No hop leads over a gap that is wide beside the others, and wide as seen from the focus: of cameras
that such gaps part, the route keeps to the largest group. Rounded with a Gaussian, it still keeps
to the cameras: the rounding is lessened until no place is farther from the nearest of them than the
longest hop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera

Floats = NDArray[np.float64]

# Cameras among which a route is looked for; more are thinned out.
_MOST = 400
# Places along a route, the share of it that a Gaussian's standard deviation has, and the least.
_PLACES, _ROUNDED, _SHARP = 600, 0.08, 0.005
# Hops shorter than this share of the longest distance count as it: cameras in one place.
_SAME = 1e-4
# A gap is so many times as wide as the usual distance to the next camera, and so many degrees as
# seen from the focus: half of the widest gap in a ring.
_WIDER, _GAP = 3.0, 36.0


@dataclass(frozen=True, eq=False)
class Route:
    """A camera path.

    Args:
        places: (N, 3) where it stands, evenly spaced along the way.
        targets: (N, 3) what it looks at.
        longest: the longest hop between two cameras of the route, in scene units.
    """

    places: Floats
    targets: Floats
    longest: float

    def at(self, shares: Floats) -> tuple[Floats, Floats]:
        """Places and targets (M, 3) at shares of the way from 0 to 1."""
        knots = np.linspace(0, 1, len(self.places))
        columns = np.concatenate([self.places, self.targets], axis=1).T
        found = np.stack([np.interp(shares, knots, column) for column in columns], axis=1)
        return found[:, :3], found[:, 3:]


def route_through(cameras: Sequence[Camera], focus: Floats, *, about: bool) -> Route:
    """The route through cameras.

    Args:
        cameras: one or more.
        focus: (3,) what they look at.
        about: they stand about the focus, so that the way from one to the next keeps its distance
            from there.
    """
    few = [cameras[k] for k in evenly(len(cameras), _MOST)]
    centers = np.array([camera.center for camera in few])
    distances = np.linalg.norm(centers[:, None] - centers, axis=2)
    gaps = _gaps(distances, centers - focus)
    group = _largest_group(gaps)
    few, centers = [few[k] for k in group], centers[group]
    targets = np.array([looked_at(camera, focus) for camera in few])
    order = _order(distances[np.ix_(group, group)], gaps[np.ix_(group, group)])
    if len(order) == 1:
        return Route(centers[order], targets[order], 0.0)
    knots, aims = centers[order], targets[order]
    hops = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    longest = float(hops.max())
    ways = np.concatenate([[0], np.cumsum(hops)]) / hops.sum()
    shares = np.linspace(0, 1, _PLACES)
    line = _along(shares, ways, knots)
    if about:
        away = np.interp(shares, ways, np.linalg.norm(knots - focus, axis=1))
        ahead = line - focus
        lengths = np.maximum(np.linalg.norm(ahead, axis=1), 1e-9 * longest)
        line = focus + ahead * (away / lengths)[:, None]
    aim = _along(shares, ways, aims)
    width = _ROUNDED
    places = _rounded(line, width)
    while width > _SHARP and _away(places, centers).max() > longest:
        width /= 2
        places = _rounded(line, width)
    return _evenly_spaced(places, _rounded(aim, max(width, _ROUNDED)), longest)


def looked_at(camera: Camera, focus: Floats) -> Floats:
    """The point (3,) on a camera's axis at the depth of the focus; ahead of it in any case."""
    center, forward = camera.center, camera.view[2, :3]
    depth = abs(float(forward @ (focus - center))) or 1.0
    return np.asarray(center + depth * forward)


def _gaps(distances: Floats, ways: Floats) -> NDArray[np.bool_]:
    """(V, V) pairs of cameras with a gap in coverage between them.

    Args:
        distances: (V, V) between cameras.
        ways: (V, 3) from the focus to them.
    """
    units = ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300)
    apart = np.degrees(np.arccos(np.clip(units @ units.T, -1, 1)))
    # Those in one place tell nothing of how far it is to the next.
    beside = distances + np.where(distances > _SAME * distances.max(), 0, np.inf)
    usual = np.median(beside.min(axis=1))
    return np.asarray((distances > _WIDER * usual) & (apart > _GAP))


def _largest_group(gaps: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Numbers of the most cameras that no gap parts, in order."""
    from scipy.sparse.csgraph import connected_components

    _, labels = connected_components(~gaps, directed=False)
    return np.flatnonzero(labels == np.bincount(labels).argmax())


def _order(distances: Floats, gaps: NDArray[np.bool_]) -> list[int]:
    """Numbers of the cameras along the route, from one end to the other, over no gap."""
    from scipy.sparse.csgraph import dijkstra

    largest = float(distances.max())
    if largest == 0:
        return [0]
    costs = np.where(gaps, np.inf, np.maximum(distances / largest, _SAME) ** 2)
    # Whoever is farthest from any camera is an end; whoever is farthest from that, the other.
    start = int(dijkstra(costs, indices=0).argmax())
    far, before = dijkstra(costs, indices=start, return_predecessors=True)
    order = [int(far.argmax())]
    while order[-1] != start:
        order.append(int(before[order[-1]]))
    return order


def _along(shares: Floats, ways: Floats, knots: Floats) -> Floats:
    return np.stack([np.interp(shares, ways, column) for column in knots.T], axis=1)


def _rounded(line: Floats, width: float) -> Floats:
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(line, width * len(line), axis=0, mode="nearest"))


def _away(places: Floats, centers: Floats) -> Floats:
    """How far each place is from the nearest camera."""
    return np.asarray(np.linalg.norm(places[:, None] - centers, axis=2).min(axis=1))


def _evenly_spaced(places: Floats, targets: Floats, longest: float) -> Route:
    """The same path with equal steps."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    ways = np.concatenate([[0], np.cumsum(steps)]) / (steps.sum() or 1.0)
    shares = np.linspace(0, 1, len(places))
    return Route(_along(shares, ways, places), _along(shares, ways, targets), longest)
