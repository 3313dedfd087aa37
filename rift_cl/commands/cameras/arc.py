"""Where about a scene cameras stood: a full ring, or the part of the sphere that they covered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.train.start.points import axes_meet

Floats = NDArray[np.float64]

# Five cameras spaced evenly are a ring; where the widest gap is wider, nobody looked from there.
_WIDEST_GAP = 72.5
# Places are the same to float32.
_ONE_PLACE = 1e-6


@dataclass(frozen=True, eq=False)
class Arc:
    """Directions and distances from which a scene was seen.

    Args:
        front: (3,) horizontal unit vector from the focus to the middle of the arc, where the
            azimuth is 0.
        azimuth: least and largest, in degrees about up, to the left as seen from above.
        elevation: least and largest, in degrees above the horizon.
        distances: from the focus in scene units: the least, the median, the largest.
        inward: the cameras looked at the focus, and not past it or side by side.
        closed: they did so from all round: at their median elevation, no place is farther from one
            of them than in a ring of five.
    """

    front: Floats
    azimuth: tuple[float, float]
    elevation: tuple[float, float]
    distances: tuple[float, float, float]
    inward: bool
    closed: bool

    def record(self) -> dict[str, Any]:
        """The arc for JSON, with angles in degrees."""
        return {
            "front": self.front,
            "azimuth": self.azimuth,
            "elevation": self.elevation,
            "distances": self.distances,
            "inward": self.inward,
            "closed": self.closed,
        }


def arc_of(cameras: Sequence[Camera], focus: Floats, up: Floats) -> Arc:
    """The arc that cameras covered.

    Args:
        cameras: one or more.
        focus: (3,) what they look at.
        up: (3,) unit vector.
    """
    ways = np.array([camera.center for camera in cameras]) - focus
    distances = np.linalg.norm(ways, axis=1)
    least, median, most = np.quantile(distances, (0, 0.5, 1)).tolist()
    units = ways / np.where(distances > 0, distances, 1)[:, None]
    elevations = np.degrees(np.arcsin(np.clip(units @ up, -1, 1)))
    first = across(up)
    second = np.cross(up, first)
    angles = np.sort(np.degrees(np.arctan2(ways @ second, ways @ first)) % 360)
    gaps = np.diff(angles, append=angles[0] + 360)
    widest = int(gaps.argmax())
    extent = float(360 - gaps[widest])
    inward = axes_meet(cameras, focus)
    middle = np.radians(angles[(widest + 1) % len(angles)] + extent / 2)
    return Arc(
        front=np.cos(middle) * first + np.sin(middle) * second,
        azimuth=(-extent / 2, extent / 2),
        elevation=(float(elevations.min()), float(elevations.max())),
        distances=(least, median, most),
        inward=inward,
        closed=inward and bool(gaps[widest] <= _WIDEST_GAP) and _all_round(units, up, elevations),
    )


def _all_round(units: Floats, up: Floats, elevations: Floats) -> bool:
    """Whether cameras are near to every place of the orbit at their median elevation.

    A few that look down from above are at every azimuth, but not where an orbit would go.
    """
    first = across(up)
    turn, rise = np.radians(np.arange(360))[:, None], np.radians(np.median(elevations))
    flat = np.cos(turn) * first + np.sin(turn) * np.cross(up, first)
    orbit = np.cos(rise) * flat + np.sin(rise) * up
    nearest = (orbit @ units.T).max(axis=1)
    return bool(nearest.min() >= np.cos(np.radians(_WIDEST_GAP / 2)))


def across(up: Floats) -> Floats:
    """A horizontal unit vector (3,), determined by up."""
    along = np.eye(3)[np.abs(up).argmin()]
    second = np.cross(up, along)
    return np.asarray(np.cross(second / np.linalg.norm(second), up))


def check_places(cameras: Sequence[Camera], where: Path) -> None:
    """Check that several cameras are not all at one position.

    Raises:
        InputError: they do.
    """
    centers = np.array([camera.center for camera in cameras])
    spread = np.ptp(centers, axis=0).max()
    if len(cameras) > 1 and spread <= _ONE_PLACE * max(1.0, np.abs(centers).max()):
        raise InputError(
            f"{where}: all {len(cameras)} cameras stand in one place, which tells nothing of "
            "depth: wanted photographs from two places or more"
        )


def place_notes(cameras: Sequence[Camera]) -> list[str]:
    """A sentence about a single photograph, which fits any depth."""
    if len(cameras) != 1:
        return []
    return [
        "One photograph alone tells nothing of depth: how far off what it shows is placed is a "
        "guess, and views from anywhere else show that guess; photograph from two places or more"
    ]
