"""The target: its position, its size, and the frequencies that count.

Lengths are in the unit of the world, frequencies in cycles per that unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.sampling.targets.prior import PowerLaw, Prior

Floats = NDArray[np.float64]
TargetMode = Literal["volume", "surface"]
# Frequencies of a set that nobody gave, in space and in the plane; its band in cycles per diameter.
_IN_SPACE, _IN_PLANE = 1500, 600
_BAND = 16.0
_MOST_DEGREE = 32
# The plastic ratio and the golden one: steps by their powers fill a square and a line evenly
# (Roberts 2018; in two dimensions the plastic ratio solves x^3 = x + 1, in three x^4 = x + 1).
_STEPS_3D = 1.2207440846057596 ** -np.arange(1.0, 4.0)
_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class Target:
    """A target, and the frequencies that are wanted of it; its arrays are read-only.

    Args:
        center: (3,) its middle.
        diameter: its size, which makes neighbouring frequencies alike within 1 / diameter.
        points: (P, 3) where coverage is counted; the middle alone by default.
        normals: (P, 3) of the surface at the points, for the mode ``surface``.
        mode: ``volume`` for what is seen through, ``surface`` for what is opaque.
        prior: the power that is expected at each frequency.
        snr: signal to noise, in power, at one cycle per diameter of one view; at k it is ``snr``
            times the prior's power. With the default and a power law of 2 one view alone has 4
            left at the end of the band. N pixels across a target of contrast c, with noise s in
            each, have about (N c / s)^2 / 40 by that law, most photographs far more; beyond the
            default the criterion counts the tails of its smooth slabs as known.
        band: the highest frequency that is wanted; 16 / diameter by default.
        degree: of the spherical harmonics of a surface's brightness, for the mode ``surface``, 0
            to 32; 0 for a surface that looks the same from all sides. Views closer together than
            half a turn divided by the degree carry the same information.
        seen_from: (D, 3) directions, from the target, from which a surface will be seen: the
            variance of its appearance counts in these alone. Default: all directions; a planner
            takes those in which its cameras may stand.
        frequencies: (K, 3) the frequencies to count with; by default ``k`` is a set that fills the
            half-ball of the band evenly (coverage at -k is that at k).

    Raises:
        ShapeError: an array has the wrong shape.
        InputError: a length is not positive, a number not finite, the mode unknown, or the prior
            none.
    """

    center: Floats
    diameter: float
    points: Floats = field(default_factory=lambda: np.empty((0, 3)))
    normals: Floats | None = None
    mode: TargetMode = "volume"
    prior: Prior = field(default_factory=lambda: PowerLaw(2.0))
    snr: float = 1000.0
    band: float | None = None
    frequencies: Floats | None = None
    degree: int = 24
    seen_from: Floats | None = None

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        center = _array("center", self.center, (3,))
        object.__setattr__(self, "center", center)
        for name in ("diameter", "snr", "band"):
            given: Any = getattr(self, name)
            if name == "band" and given is None:
                continue
            if not one_number(given) > 0:
                raise InputError(f"Target: {name} is {given!r}, wanted a positive number")
            object.__setattr__(self, name, one_number(given))
        points = self.points if np.size(self.points) else center[None]
        object.__setattr__(self, "points", _array("points", points, (None, 3)))
        if self.frequencies is not None:
            k = _array("frequencies", self.frequencies, (None, 3))
            object.__setattr__(self, "frequencies", k)
        if not callable(getattr(self.prior, "power", None)):
            raise InputError(
                f"Target: prior is {self.prior!r}, wanted PowerLaw, Spectrum, Pilot or another "
                "object with a method power(k, diameter)"
            )
        self._check_mode()

    def __eq__(self, other: object) -> bool:
        """Targets are equal when all their numbers are, and their priors."""
        return isinstance(other, Target) and (
            (self._key(), self.prior) == (other._key(), other.prior)
        )

    def __hash__(self) -> int:
        """Equal targets hash equally; a prior of one's own need not be hashable."""
        return hash(self._key())

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Be a copy, whose arrays are read-only as well."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        vars(self).update(state)

    def _key(self) -> tuple[Any, ...]:
        values = (getattr(self, entry.name) for entry in fields(self) if entry.name != "prior")
        return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)

    def _check_mode(self) -> None:
        if self.seen_from is not None:
            toward = _array("seen_from", self.seen_from, (None, 3))
            object.__setattr__(self, "seen_from", _units("seen_from", toward))
        if self.degree not in range(_MOST_DEGREE + 1):
            raise InputError(f"Target: degree is {self.degree!r}, wanted 0 to {_MOST_DEGREE}")
        if self.mode not in ("volume", "surface"):
            raise InputError(f"Target: mode is {self.mode!r}, wanted volume or surface")
        if self.normals is None:
            if self.mode == "surface":
                raise InputError("Target: mode is surface, wanted normals (P, 3) of its points")
            return
        normals = _array("normals", self.normals, (len(self.points), 3))
        object.__setattr__(self, "normals", _units("normals", normals))

    @classmethod
    def flat(cls, diameter: float, center: ArrayLike = (0, 0, 0), **settings: Any) -> Target:
        """A target in the plane z = 0, as slices of a scan are: its frequencies have kz = 0.

        Args:
            diameter: its size.
            center: (2,) or (3,) its middle.
            **settings: the other arguments of ``Target``.

        Raises:
            ShapeError: an array has the wrong shape.
            InputError: a frequency lies outside the plane, or what ``Target`` refuses.
        """
        middle = np.zeros(3)
        given = _array("center", center, (3,) if np.size(center) == 3 else (2,))
        middle[: len(given)] = given
        target = cls(middle, diameter, **settings)
        if target.frequencies is not None:
            if not target.is_flat:
                raise InputError("Target.flat: frequencies reach out of the plane, wanted kz = 0")
            return target
        k = half_disc(target.highest)
        return cls(middle, diameter, **{**settings, "frequencies": k})

    @property
    def highest(self) -> float:
        """The highest frequency that is wanted."""
        return self.band if self.band is not None else _BAND / self.diameter

    @cached_property
    def k(self) -> Floats:
        """(K, 3) the frequencies to count with; read-only."""
        if self.frequencies is not None:
            return self.frequencies
        return _held(half_ball(self.highest))

    @property
    def is_flat(self) -> bool:
        """Whether all its frequencies lie in the plane kz = 0."""
        return not self.k[:, 2].any()


def half_ball(band: float, count: int = _IN_SPACE) -> Floats:
    """Frequencies that fill the half-ball kz > 0 of a radius evenly, (count, 3)."""
    i = np.arange(1, count + 1)[:, None]
    return ball_of(band, np.mod(0.5 + i * _STEPS_3D, 1))


def half_disc(band: float, count: int = _IN_PLANE) -> Floats:
    """Frequencies that fill the half-disc ky > 0, kz = 0 evenly, (count, 3)."""
    i = np.arange(count)
    return disc_of(band, np.stack([(i + 0.5) / count, np.mod((i + 1) * _GOLDEN, 1)], axis=1))


def ball_of(band: float, places: Floats) -> Floats:
    """Points (n, 3) of the unit cube on the half-ball kz > 0 of a radius, equal volumes alike."""
    radius, height, turn = places.T
    across = np.sqrt((1 - height) * (1 + height))
    unit = [across * np.cos(2 * np.pi * turn), across * np.sin(2 * np.pi * turn), height]
    return np.asarray(band * np.cbrt(radius) * np.stack(unit)).T.copy()


def disc_of(band: float, places: Floats) -> Floats:
    """Points (n, 2) of the unit square on the half-disc ky > 0, kz = 0, equal areas alike."""
    radius, turn = np.sqrt(places[:, 0]), places[:, 1]
    unit = [np.cos(np.pi * turn), np.sin(np.pi * turn), np.zeros(len(places))]
    return np.asarray(band * radius * np.stack(unit)).T.copy()


def _units(name: str, vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not lengths.all():
        raise InputError(f"Target: {name}[{int(np.argmin(lengths))}] is zero")
    return _held(np.asarray(vectors / lengths))


def _array(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    array = real_numbers(values)
    wanted = str(tuple("n" if n is None else n for n in shape)).replace("'", "")
    if array is None:
        raise InputError(f"Target: {name} is {values!r}, wanted real numbers of shape {wanted}")
    fits = array.ndim == len(shape) and all(
        n == (m if m is not None else max(n, 1)) for n, m in zip(array.shape, shape, strict=True)
    )
    if not fits:
        raise ShapeError(f"Target: {name} has shape {array.shape}, wanted {wanted}")
    if not np.isfinite(array).all():
        raise NonFiniteError(f"Target: {name} holds NaN or infinity, every entry must be finite")
    return _held(array)


def _held(array: Floats) -> Floats:
    """The same array, which nobody can change any more."""
    array.flags.writeable = False
    return array
