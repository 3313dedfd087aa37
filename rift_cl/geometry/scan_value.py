"""What the geometries of scans have in common: equality by value, and arguments that are checked.

Every check names the class and the argument, says what came and what was wanted.
"""

from __future__ import annotations

import hashlib
import math
import weakref
from collections.abc import Iterable
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers

if TYPE_CHECKING:
    from typing_extensions import Self

# Whole turns in degrees. Evenly spaced angles that fill one of them to rounding are degrees.
_TURNS_IN_DEGREES = (180.0, 360.0, 720.0)
_TURN_TOLERANCE = 1e-5
# Those of an encoder are even to such a part of a step, and fill a turn to half a step.
_JITTER, _FILLS = 0.1, 0.5
# Beyond two turns in radians, lists of round numbers are degrees: a turn is no such number.
_ROUND_BEYOND = 4 * np.pi
_ROUND_STEP = 0.25
_FEWEST_ROUND = 8
# Of steps beyond a turn in radians, which no scan has, fewer tell as much.
_FEWEST_COARSE = 4
# The golden angle in degrees, of a turn and of half a turn, and how near to it steps are.
_GOLDEN_IN_DEGREES = (180 * (3 - 5**0.5), 90 * (5**0.5 - 1))
_NEAR_GOLDEN = 0.01

# Arrays of so many numbers are told in full.
_FEW_NUMBERS = 4

# Angles that scans hold, by identity. A few of them may look like degrees, which all did not.
_held_angles: weakref.WeakValueDictionary[int, NDArray[np.float64]] = weakref.WeakValueDictionary()


class ScanValue:
    """A frozen dataclass whose fields are its constructor's arguments, arrays among them.

    Every array, and the first field is one, has an entry for each view; ``_lengths`` names the
    fields that are lengths.
    """

    _lengths: ClassVar[tuple[str, ...]] = ()

    def __eq__(self, other: object) -> bool:
        """Scans are equal when every ray is."""
        return type(other) is type(self) and self._key() == other._key()

    def __hash__(self) -> int:
        """Equal scans hash equally."""
        return hash(self._key())

    def __repr__(self) -> str:
        names = (field.name for field in fields(self))  # type: ignore[arg-type]
        told = ", ".join(f"{name}={_told(getattr(self, name))}" for name in names)
        return f"{type(self).__name__}({told})"

    @property
    def digest(self) -> str:
        """Sixteen hexadecimal digits that equal scans have in common, in every process."""
        return hashlib.sha256(repr(self._key()).encode()).hexdigest()[:16]

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies are made by the constructor, so that their arrays are read-only as well."""
        return _restored, (type(self), self._values())

    @property
    def views(self) -> int:
        """Number of views."""
        return len(self._values()[0])

    def subset(self, views: ArrayLike) -> Self:
        """The scan of some views.

        Args:
            views: their numbers, or a truth value for each view.
        """
        chosen = np.asarray(views)
        values = self._values()
        return self._with(
            value[chosen] if isinstance(value, np.ndarray) else value for value in values
        )

    def at(self, angles: NDArray[np.float64]) -> Self:
        """The same scan at other angles, which are radians whatever they look like.

        Args:
            angles: finite, as many as there are, computed from those of this scan.
        """
        _, *others = self._values()
        return self._with([np.add(angles, 0.0), *others])

    def scaled(self, factor: float) -> Self:
        """The same scan with every length times a factor, as for another unit.

        Raises:
            InputError: the factor is no positive number.
        """
        times = checked_length(type(self).__name__, "factor", factor)
        values = dict(zip((field.name for field in fields(self)), self._values(), strict=True))  # type: ignore[arg-type]
        for name in self._lengths:
            values[name] = np.multiply(values[name], times)
        return type(self)(**values)

    def _with(self, values: Iterable[Any]) -> Self:
        return cast("Self", _restored(type(self), tuple(values)))

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, field.name) for field in fields(self))  # type: ignore[arg-type]

    def _key(self) -> tuple[Any, ...]:
        return tuple(
            value.tobytes() if isinstance(value, np.ndarray) else value for value in self._values()
        )


def _told(value: Any) -> str:
    """A field in a few words, for an array may have thousands of numbers."""
    if not isinstance(value, np.ndarray):
        return repr(value)
    if value.size <= _FEW_NUMBERS:
        return str(value.tolist())
    if value.ndim > 1:
        return f"<{' x '.join(map(str, value.shape))} numbers>"
    return f"<{value.size} numbers from {value[0]:.6g} to {value[-1]:.6g}>"


def _restored(kind: type[Any], values: tuple[Any, ...]) -> Any:
    """A scan of what another scan held, whose angles are taken for radians unseen."""
    first = values[0]
    if np.ndim(first) == 1 and np.size(first) > 0:
        _hold(first)
    return kind(*values)


def _hold(angles: NDArray[np.float64]) -> None:
    angles.flags.writeable = False
    _held_angles[id(angles)] = angles


def checked_angles(owner: str, angles: ArrayLike, *, helix: bool = False) -> NDArray[np.float64]:
    """Angles as a read-only float64 array of one dimension; those of another scan as they are.

    Args:
        owner: name of the class that they are given to.
        angles: in radians, at least one.
        helix: whether they may go round many times.

    Raises:
        ShapeError: there are none, or not in one dimension.
        InputError: they are no finite numbers, or look like degrees.
    """
    held = _held_angles.get(id(angles))
    if held is not None and held is angles:
        return held
    values = real_numbers(angles)
    if values is None:
        raise InputError(f"{owner}: angles is {angles!r}, wanted real numbers, in radians")
    if values.ndim != 1:
        raise ShapeError(f"{owner}: angles has shape {values.shape}, wanted one dimension")
    if values.size == 0:
        raise ShapeError(f"{owner}: angles is empty; a scan needs at least one direction")
    if not np.isfinite(values).all():
        index = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(f"{owner}: angles[{index}] is {values[index]}, wanted a finite number")
    _refuse_degrees(owner, values, helix=helix)
    _hold(values)
    return values


def _refuse_degrees(owner: str, angles: NDArray[np.float64], *, helix: bool) -> None:
    """Refuse angles that are degrees by all appearance.

    Even steps that fill half a turn, a turn or two in degrees or are the golden angle, or eight and
    more steps that fill these turns nearly, as an encoder reads them; and eight and more angles
    that would fill more than two turns as radians, and are multiples of a quarter or lead in even
    steps from one whole number to another, or from minus a half of one to the half; four, if a step
    is beyond a turn. A helix has many turns: of it, only the first is refused.

    Raises:
        InputError: they do; the message names the remedy.
    """
    if len(angles) < 3:
        return
    steps = np.diff(angles)
    span = float(np.ptp(angles))
    even = bool(np.ptp(steps) <= _TURN_TOLERANCE * span)
    wholes = (span, span + abs(float(steps[0])))
    for turn in _TURNS_IN_DEGREES if even else ():
        if any(abs(whole - turn) < _TURN_TOLERANCE * turn for whole in wholes):
            _refuse(owner, f"fill {turn:g} in even steps")
    if any(_goes_by(steps, golden) for golden in _GOLDEN_IN_DEGREES):
        _refuse(owner, f"go on by the golden angle, {steps[0]:g}")
    step = float(steps.mean())
    # Steps that are even to rounding were computed, and may be radians of many turns.
    if (
        not even
        and len(angles) >= _FEWEST_ROUND
        and np.abs(steps - step).max() <= _JITTER * abs(step)
    ):
        for turn in _TURNS_IN_DEGREES:
            if any(abs(whole - turn) <= _FILLS * abs(step) for whole in wholes):
                _refuse(owner, f"fill {turn:g} in nearly even steps")
    fewest = _FEWEST_COARSE if even and abs(step) > 2 * np.pi else _FEWEST_ROUND
    if helix or len(angles) < fewest or span <= _ROUND_BEYOND:
        return
    ends = angles[[0, -1]]
    whole = 0.5 if ends.sum() == 0 else 1.0
    if _are_round(angles, _ROUND_STEP) or (even and _are_round(ends, whole)):
        _refuse(owner, f"go in round numbers from {angles.min():g} to {angles.max():g}")


def _goes_by(steps: NDArray[np.float64], degrees: float) -> bool:
    """Whether all steps, but for half turns, are so many degrees, in either sense."""
    away = [np.mod(sense * steps - degrees + 90, 180) - 90 for sense in (1, -1)]
    return any(bool((np.abs(each) < _NEAR_GOLDEN).all()) for each in away)


def _are_round(values: NDArray[np.float64], step: float) -> bool:
    return bool((np.abs(values / step - np.round(values / step)) < _TURN_TOLERANCE).all())


def _refuse(owner: str, why: str) -> NoReturn:
    raise InputError(
        f"{owner}: angles {why}, which looks like degrees; wanted radians: numpy.deg2rad(angles), "
        "or numpy.mod(angles, 2 * numpy.pi) where they are radians of many turns"
    )


def checked_count(owner: str, name: str, value: Any) -> int:
    """A positive whole number.

    Raises:
        ShapeError: it is none.
    """
    count = one_number(value)
    if not (count >= 1 and count.is_integer()):
        raise ShapeError(f"{owner}: {name} is {value!r}, wanted a positive whole number")
    return int(count)


def checked_length(owner: str, name: str, value: Any) -> float:
    """A positive length.

    Raises:
        InputError: it is none.
    """
    length = one_number(value)
    if math.isnan(length):
        raise InputError(f"{owner}: {name} is {value!r}, wanted a finite number")
    if not length > 0:
        raise InputError(f"{owner}: {name} is {value!r}, wanted a positive length")
    return length


def checked_center(owner: str, value: Any, middle: float | None = None) -> float:
    """The bin at which the axis is seen: ``middle`` if ``value`` is None.

    Raises:
        InputError: it is no finite number.
    """
    center = one_number(middle if value is None else value)
    if math.isnan(center):
        raise InputError(f"{owner}: center is {value!r}, wanted a bin number")
    return center


def checked_distances(owner: str, to_axis: Any, to_detector: Any) -> tuple[float, float]:
    """Distances of the source from the axis and from the detector.

    Raises:
        InputError: one is no positive length, or the detector stands before the axis.
    """
    axis = checked_length(owner, "source_to_axis", to_axis)
    detector = checked_length(owner, "source_to_detector", to_detector)
    if not detector >= axis:
        raise InputError(
            f"{owner}: source_to_detector is {detector:g}, source_to_axis is {axis:g}; "
            "the detector stands behind the axis"
        )
    return axis, detector


def refuse_round_arcs(
    owner: str, bins: int, center: float, pitch: float, to_detector: float
) -> None:
    """Refuse arcs about the source whose bins would go all the way round it.

    Raises:
        InputError: they do.
    """
    farthest = max(center + 0.5, bins - 0.5 - center) * pitch / to_detector
    if farthest >= math.pi:
        raise InputError(
            f"{owner}: pitch is {pitch:g}, so that the arc of {bins} bins {to_detector:g} from the "
            f"source ends at {math.degrees(farthest):.3g} degrees from its axis; "
            "check that pitch and source_to_detector are in one unit"
        )
