"""Kinds of camera paths: free positions, rings, or one smooth curve."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.errors import InputError


@dataclass(frozen=True)
class Free:
    """Camera positions are independent of each other."""


@dataclass(frozen=True)
class Ring:
    """One circle round ``up`` at one elevation and distance, or an arc of it; evenly spaced.

    Where azimuth is limited the views go from its first to its last.
    """


@dataclass(frozen=True)
class TiltedRings:
    """Circles about axes that lean away from ``up``, with as many views on each.

    Two great circles that cross see every direction that cone-beam tomography asks for; one does
    not (Tuy 1983).

    Args:
        count: of the rings.

    Raises:
        InputError: there is none.
    """

    count: int = 2

    def __post_init__(self) -> None:
        """Check the count."""
        _check("TiltedRings: count", self.count, 1)


@dataclass(frozen=True)
class Spline:
    """One smooth curve (a uniform cubic B-spline in azimuth, elevation and distance).

    It stays within the box of its control points, so that it keeps the limits that they keep.
    Views are evenly spaced along its length. The planner tries one turn and more, and arcs and
    loops within sectors.

    Args:
        controls: number of control points.
        closed: whether it ends where it began; whichever is better if None.

    Raises:
        InputError: there are fewer than four control points.
    """

    controls: int = 8
    closed: bool | None = None

    def __post_init__(self) -> None:
        """Check the count."""
        _check("Spline: controls", self.controls, 4)


Path = Free | Ring | TiltedRings | Spline


def _check(name: str, count: object, least: int) -> None:
    if not isinstance(count, int) or isinstance(count, bool) or count < least:
        raise InputError(f"{name} is {count!r}, wanted a whole number, {least} or more")
