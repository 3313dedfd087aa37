"""How a slice was looked at from a point: source and detector of a fan-beam scan.

At angle a the source stands at ``source_to_axis * (sin a, -cos a)`` and looks across the rotation
axis at a straight detector, ``source_to_detector`` away from it. Bins grow along
``(cos a, sin a)``, as those of a ``Parallel`` scan of the same angle do, and bin k has its centre
at ``u = (k - center) * pitch`` from the foot of the source on the detector; the line from the
source to ``center`` goes through the axis.

The ray of bin k leaves that line by the fan angle ``gamma = atan(u / source_to_detector)``. It is
the ray of a parallel scan at the angle ``a - gamma`` with ``t = source_to_axis * sin(gamma)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import checked_flag
from rift_cl.geometry.scan_value import (
    ScanValue,
    checked_angles,
    checked_center,
    checked_count,
    checked_distances,
    checked_length,
    refuse_round_arcs,
)


@dataclass(frozen=True)
class FanBeam:
    """Source and detector of a fan-beam scan; all lengths are in one unit.

    Args:
        source_to_axis: distance of the source from the rotation axis.
        source_to_detector: distance of the source from the detector, beyond the axis.
        pitch: distance between bins on the detector.
        center: bin, possibly fractional, at which the rotation axis is seen.

    Raises:
        InputError: one of them is not a usable number, or the detector stands before the axis.
    """

    source_to_axis: float
    source_to_detector: float
    pitch: float
    center: float

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        lengths = checked_distances("FanBeam", self.source_to_axis, self.source_to_detector)
        object.__setattr__(self, "source_to_axis", lengths[0])
        object.__setattr__(self, "source_to_detector", lengths[1])
        object.__setattr__(self, "pitch", checked_length("FanBeam", "pitch", self.pitch))
        object.__setattr__(self, "center", checked_center("FanBeam", self.center))

    @property
    def magnification(self) -> float:
        """How much larger the detector shows what stands at the axis."""
        return self.source_to_detector / self.source_to_axis

    def fan_angles(self, bins: int) -> NDArray[np.float64]:
        """The fan angle of every bin's ray in radians.

        Args:
            bins: number of bins in a row of the detector.

        Raises:
            ShapeError: ``bins`` is not a positive whole number.
        """
        count = checked_count("FanBeam", "bins", bins)
        return fan_angles(count, self.center, self.pitch, self.source_to_detector)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Fan(ScanValue):
    """A fan-beam scan of a slice, or of every slice of a volume in the same way.

    Args:
        angles: of the source in radians, any order, any range; kept as a read-only float64 array.
        bins: number of detector bins in a row.
        pitch: distance between bins on the detector, in the grid's unit of length.
        source_to_axis: distance of the source from the rotation axis.
        source_to_detector: distance of the source from the detector, beyond the axis.
        center: bin, possibly fractional, at which the axis is seen; ``(bins - 1) / 2`` when not
            given.
        curved: the detector is an arc about the source, bins are ``pitch`` apart along it, and
            the fan angle is ``(k - center) * pitch / source_to_detector``.

    Raises:
        ShapeError: ``angles`` is empty or not one-dimensional, or ``bins`` is not positive.
        InputError: another argument is not a usable number, the detector stands before the axis,
            an arc goes all the way round the source, or the angles look like degrees.
    """

    _lengths: ClassVar[tuple[str, ...]] = ("pitch", "source_to_axis", "source_to_detector")

    angles: NDArray[np.float64]
    bins: int
    pitch: float
    source_to_axis: float
    source_to_detector: float
    center: float
    curved: bool

    def __init__(
        self,
        angles: ArrayLike,
        bins: int,
        pitch: float,
        source_to_axis: float,
        source_to_detector: float,
        center: float | None = None,
        curved: bool = False,
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(self, "angles", checked_angles("Fan", angles))
        object.__setattr__(self, "bins", checked_count("Fan", "bins", bins))
        object.__setattr__(self, "pitch", checked_length("Fan", "pitch", pitch))
        lengths = checked_distances("Fan", source_to_axis, source_to_detector)
        object.__setattr__(self, "source_to_axis", lengths[0])
        object.__setattr__(self, "source_to_detector", lengths[1])
        middle = (self.bins - 1) / 2
        object.__setattr__(self, "center", checked_center("Fan", center, middle))
        object.__setattr__(self, "curved", checked_flag("Fan", "curved", curved))
        if self.curved:
            where = self.bins, self.center, self.pitch, self.source_to_detector
            refuse_round_arcs("Fan", *where)

    @property
    def magnification(self) -> float:
        """How much larger the detector shows what stands at the axis."""
        return self.source_to_detector / self.source_to_axis

    @property
    def beam(self) -> FanBeam:
        """Source and detector without the angles."""
        return FanBeam(self.source_to_axis, self.source_to_detector, self.pitch, self.center)

    def fan_angles(self) -> NDArray[np.float64]:
        """The fan angle of every bin's ray in radians, (bins,)."""
        where = self.bins, self.center, self.pitch, self.source_to_detector
        return fan_angles(*where, curved=self.curved)


def fan_angles(
    bins: int, center: float, pitch: float, distance: float, *, curved: bool = False
) -> NDArray[np.float64]:
    """Angles between the rays of a row's bins and the ray through the axis, in radians, (bins,).

    Args:
        bins: of the row.
        center: bin at which the axis is seen.
        pitch: distance between bins, along the row.
        distance: of the source from the detector.
        curved: whether the row is an arc about the source.
    """
    u = (np.arange(bins, dtype=np.float64) - center) * pitch
    gamma: NDArray[np.float64] = u / distance if curved else np.arctan2(u, distance)
    return gamma
