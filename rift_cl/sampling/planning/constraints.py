"""Constraints of a plan: camera positions, camera settings, and total cost.

Elevation is the angle above the plane through the target's centre across ``up``, azimuth the angle
round ``up``, both in radians; lengths are in the unit of the world.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, check_type
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.sampling.planning.keep_out import KeepOut
from rift_cl.sampling.planning.paths import Free, Path, Ring, Spline, TiltedRings

Pair = tuple[float, float]
_QUARTER = math.pi / 2
# What rounding may add to an angle.
_SLACK = 1e-9


@dataclass(frozen=True)
class Ranges:
    """What of a camera type can be set, each from the first number to the second.

    What is None stays as the type has it.

    Args:
        focal_length: of a zoom lens.
        f_number: of a lens with an iris.
        focus: of the plane in focus, how far behind the target's centre; negative for in front.
        exposure: in the unit of ``CameraType.exposure``.

    Raises:
        InputError: a range is no pair of rising numbers, or not positive.
    """

    focal_length: Pair | None = None
    f_number: Pair | None = None
    focus: Pair | None = None
    exposure: Pair | None = None

    def __post_init__(self) -> None:
        """Check the pairs."""
        for entry in fields(self):
            given = getattr(self, entry.name)
            if given is None:
                continue
            low, high = _pair(f"Ranges: {entry.name}", given)
            if entry.name != "focus" and low <= 0:
                raise InputError(f"Ranges: {entry.name} is {given!r}, wanted positive numbers")
            object.__setattr__(self, entry.name, (low, high))


@dataclass(frozen=True)
class Budget:
    """What all new views together may cost.

    A view costs ``per_view`` and ``per_exposure`` for each unit of its exposure: ``Budget(20)`` is
    20 views, ``Budget(3.5, per_view=0, per_exposure=1)`` an exposure of 3.5 in all.

    Args:
        total: of all views.
        per_view: of one view of any type, or by the name of the type.
        per_exposure: of one unit of exposure.

    Raises:
        InputError: the total is not positive, a cost negative, or views cost nothing.
    """

    total: float
    per_view: float | Mapping[str, float] = 1.0
    per_exposure: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not 0 < one_number(self.total) < math.inf:
            raise InputError(f"Budget: total is {self.total!r}, wanted a positive number")
        by_name = self.per_view if isinstance(self.per_view, Mapping) else {"": self.per_view}
        costs = {f"per_view of {name!r}" if name else "per_view": c for name, c in by_name.items()}
        costs["per_exposure"] = self.per_exposure
        for name, cost in costs.items():
            if not one_number(cost) >= 0:
                raise InputError(f"Budget: {name} is {cost!r}, wanted 0 or more")
        if not any(costs.values()):
            raise InputError("Budget: views cost nothing, wanted per_view or per_exposure above 0")

    def cost(self, name: str, exposure: float) -> float:
        """Of one view by a camera of a type.

        Raises:
            InputError: costs go by name, and this one has none.
        """
        if not isinstance(self.per_view, Mapping):
            return self.per_view + self.per_exposure * exposure
        if name not in self.per_view:
            raise InputError(f"Budget: per_view names {sorted(self.per_view)}, but not {name!r}")
        return self.per_view[name] + self.per_exposure * exposure


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints on camera positions and settings.

    Args:
        elevation: lowest and highest, radians from -pi / 2 to pi / 2.
        azimuth: first and last, radians; a difference of 2 pi is the full circle.
        distance: from the target's centre: one, or nearest and farthest. When not given, each type
            stands as near as it can with ``cover``.
        keepouts: places where no camera may stand, or behind which it sees nothing.
        cover: the least part of the target's ball, as a share of the area of its outline, that
            must lie in the picture; more than 0, up to 1.
        path: how places hang together: ``Free``, ``Ring``, ``TiltedRings`` or ``Spline``.
        budget: what the views may cost together; nothing but their number limits them if None.
        ranges: what of each type can be set, by the type's name.
        up: (3,) which way is up, in world coordinates.

    Raises:
        InputError: a range is empty, or a number out of its range.
    """

    elevation: Pair = (-_QUARTER, _QUARTER)
    azimuth: Pair = (-math.pi, math.pi)
    distance: float | Pair | None = None
    keepouts: tuple[KeepOut, ...] = ()
    cover: float = 1.0
    path: Path = field(default_factory=Free)
    budget: Budget | None = None
    ranges: Mapping[str, Ranges] = field(default_factory=dict)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        low, high = _pair("Constraints: elevation", self.elevation)
        if low < -_QUARTER - _SLACK or high > _QUARTER + _SLACK:
            raise InputError(
                f"Constraints: elevation is {self.elevation!r}, wanted radians from -pi / 2 to "
                "pi / 2; were these degrees?"
            )
        self._set("elevation", (max(low, -_QUARTER), min(high, _QUARTER)))
        first, last = _pair("Constraints: azimuth", self.azimuth)
        if last - first > 2 * math.pi + 1e-6:
            raise InputError(
                f"Constraints: azimuth is {self.azimuth!r}, more than a circle; were these degrees?"
            )
        self._set("azimuth", (first, min(last, first + 2 * math.pi)))
        _ = self.distances
        check_type("Constraints", "keepouts", self.keepouts, Iterable)
        check_type("Constraints", "ranges", self.ranges, Mapping)
        self._set("keepouts", tuple(self.keepouts))
        self._check_kinds()
        if not 0 < one_number(self.cover) <= 1:
            raise InputError(f"Constraints: cover is {self.cover!r}, wanted more than 0, up to 1")
        up = real_numbers(self.up)
        if up is None or up.shape != (3,) or not np.isfinite(up).all() or not up.any():
            raise InputError(f"Constraints: up is {self.up!r}, wanted a direction (3,)")
        if isinstance(self.path, TiltedRings) and not self.full_circle:
            raise InputError(
                f"Constraints: tilted rings go all the way round, but azimuth is {self.azimuth!r}: "
                "take the path Ring, Spline or Free, or the full circle"
            )

    def _check_kinds(self) -> None:
        for index, keepout in enumerate(self.keepouts):
            if not isinstance(keepout, KeepOut):
                raise InputError(f"Constraints: keepouts[{index}] is {keepout!r}, wanted a KeepOut")
        if not isinstance(self.path, Free | Ring | TiltedRings | Spline):
            raise InputError(
                f"Constraints: path is {self.path!r}, wanted Free(), Ring(), TiltedRings() or "
                "Spline()"
            )
        if self.budget is not None and not isinstance(self.budget, Budget):
            raise InputError(f"Constraints: budget is {self.budget!r}, wanted a Budget")
        for name, ranges in self.ranges.items():
            if not isinstance(ranges, Ranges):
                raise InputError(f"Constraints: ranges[{name!r}] is {ranges!r}, wanted Ranges")

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    @property
    def distances(self) -> Pair | None:
        """Nearest and farthest; None where each type finds its own."""
        return None if self.distance is None else _distances(self.distance)

    @property
    def full_circle(self) -> bool:
        """Whether the azimuth is the full circle."""
        return self.azimuth[1] - self.azimuth[0] > 2 * math.pi - 1e-6

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) rows: azimuth zero, azimuth of a quarter turn, and up, in world coordinates."""
        up = np.asarray(self.up, np.float64) / np.linalg.norm(self.up)
        # Azimuth zero is x, or y where x is up.
        start = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
        start = start - (start @ up) * up
        start /= np.linalg.norm(start)
        return np.stack([start, np.cross(up, start), up])

    def frames(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V, 3, 3) rows: unit vectors outwards, along growing azimuth, and upright.

        Args:
            angles: (V, 2) azimuths and elevations.
        """
        (ca, ce), (sa, se) = np.cos(angles).T, np.sin(angles).T
        local = [[ce * ca, ce * sa, se], [-sa, ca, 0 * ca], [-se * ca, -se * sa, ce]]
        return np.moveaxis(np.array(local), 2, 0) @ self.axes


def _pair(name: str, values: Any) -> Pair:
    numbers = real_numbers(values)
    if numbers is None or numbers.shape != (2,) or not np.isfinite(numbers).all():
        raise InputError(f"{name} is {values!r}, wanted two numbers, the smaller first")
    low, high = numbers.tolist()
    if low > high:
        raise InputError(f"{name} is {values!r}, an empty range: wanted the smaller number first")
    return low, high


def _distances(values: Any) -> Pair:
    one = real_numbers(values)
    given = (values, values) if one is not None and one.ndim == 0 else values
    low, high = _pair("Constraints: distance", given)
    if low <= 0:
        raise InputError(f"Constraints: distance is {values!r}, wanted positive lengths")
    return low, high
