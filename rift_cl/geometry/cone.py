"""How a target was looked at from a point: source and area detector of a cone-beam scan.

At angle a the source stands at ``source_to_axis * (sin a, -cos a)`` and at ``height`` along z, the
rotation axis, and looks across the axis at a detector ``source_to_detector`` away from it. Column k
has its centre at ``u = (k - center[1]) * pitch[1]`` along ``(cos a, sin a)``, row i at
``v = (i - center[0]) * pitch[0]`` along z, both from the foot of the source on the detector: the
line from the source to ``center`` goes through the axis at a right angle. A point (x, y, z) is seen
at

    D = source_to_axis - x sin a + y cos a,
    u = source_to_detector (x cos a + y sin a) / D,   v = source_to_detector (z - height) / D.

Row ``center[0]`` of a cone is a ``Fan``; a cone of which the source is far away is a ``Parallel``.
A scan whose source or detector stands otherwise, view by view, is a ``Vectors``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError, checked_flag
from rift_cl.geometry.fan import Fan, fan_angles
from rift_cl.geometry.numbers import real_numbers
from rift_cl.geometry.scan_value import (
    ScanValue,
    checked_angles,
    checked_center,
    checked_count,
    checked_distances,
    checked_length,
    refuse_round_arcs,
)
from rift_cl.geometry.vectors import Vectors


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Cone(ScanValue):
    """A cone-beam scan of a volume: a circle, or with heights a helix or steps.

    Args:
        angles: of the source in radians, any order, any range; kept as a read-only float64 array.
        rows: number of detector rows.
        bins: number of bins in a row.
        pitch: distance between bins on the detector, in the grid's unit of length; one number, or
            (between rows, between the bins of a row). Kept as the latter.
        source_to_axis: distance of the source from the rotation axis.
        source_to_detector: distance of the source from the detector, beyond the axis.
        center: (row, bin), possibly fractional, at which the source's foot on the detector lies,
            and the axis with it; ``((rows - 1) / 2, (bins - 1) / 2)`` when not given.
        heights: of source and detector along z, one for each angle; 0 when not given.
        curved: each row is an arc about the source, its bins are ``pitch`` apart along it: the fan
            angle is ``(k - center[1]) * pitch[1] / source_to_detector``. Columns are straight.

    Raises:
        ShapeError: ``angles`` is empty or not one-dimensional, a count is not positive, or pitch,
            centre or heights have other lengths than those named.
        InputError: an argument is not a usable number, the detector stands before the axis, an arc
            goes all the way round the source, or the angles look like degrees.
    """

    _lengths: ClassVar[tuple[str, ...]] = (
        "pitch",
        "source_to_axis",
        "source_to_detector",
        "heights",
    )

    angles: NDArray[np.float64]
    rows: int
    bins: int
    pitch: tuple[float, float]
    source_to_axis: float
    source_to_detector: float
    center: tuple[float, float]
    heights: NDArray[np.float64]
    curved: bool

    def __init__(
        self,
        angles: ArrayLike,
        rows: int,
        bins: int,
        pitch: float | ArrayLike,
        source_to_axis: float,
        source_to_detector: float,
        center: ArrayLike | None = None,
        heights: ArrayLike | None = None,
        curved: bool = False,
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(
            self, "angles", checked_angles("Cone", angles, helix=heights is not None)
        )
        object.__setattr__(self, "rows", checked_count("Cone", "rows", rows))
        object.__setattr__(self, "bins", checked_count("Cone", "bins", bins))
        object.__setattr__(self, "pitch", _pitch(pitch))
        lengths = checked_distances("Cone", source_to_axis, source_to_detector)
        object.__setattr__(self, "source_to_axis", lengths[0])
        object.__setattr__(self, "source_to_detector", lengths[1])
        object.__setattr__(self, "center", _center(center, self.rows, self.bins))
        object.__setattr__(self, "heights", _heights(heights, len(self.angles)))
        object.__setattr__(self, "curved", checked_flag("Cone", "curved", curved))
        if self.curved:
            where = self.bins, self.center[1], self.pitch[1], self.source_to_detector
            refuse_round_arcs("Cone", *where)

    @property
    def magnification(self) -> float:
        """How much larger the detector shows what stands at the axis."""
        return self.source_to_detector / self.source_to_axis

    @property
    def circular(self) -> bool:
        """Whether all heights are equal."""
        return bool(np.all(self.heights == self.heights[0]))

    @property
    def source(self) -> NDArray[np.float64]:
        """Where the source stands in every view, (views, 3) as (x, y, z)."""
        places = -self.source_to_axis * _frame(self.angles)[1]
        places[:, 2] = self.heights
        return places

    def fan_angles(self) -> NDArray[np.float64]:
        """Angles of the columns' rays in the plane across the axis, in radians, (bins,)."""
        where = self.bins, self.center[1], self.pitch[1], self.source_to_detector
        return fan_angles(*where, curved=self.curved)

    def cone_angles(self) -> NDArray[np.float64]:
        """Angles of the rows' rays out of that plane at ``center[1]``, in radians, (rows,)."""
        return fan_angles(self.rows, self.center[0], self.pitch[0], self.source_to_detector)

    def fan(self) -> Fan:
        """The fan of row ``center[0]``."""
        return Fan(
            self.angles,
            self.bins,
            self.pitch[1],
            self.source_to_axis,
            self.source_to_detector,
            self.center[1],
            self.curved,
        )

    def vectors(self) -> Vectors:
        """The same rays as places of source and detector.

        Raises:
            InputError: the detector is curved.
        """
        if self.curved:
            raise InputError("Cone: curved is True; vectors describe flat detectors alone")
        along, ahead = _frame(self.angles)
        up = np.array([0.0, 0.0, 1.0])
        source = self.source
        off = (np.array([self.rows, self.bins]) - 1) / 2 - self.center
        middle = source + self.source_to_detector * ahead
        middle = middle + off[1] * self.pitch[1] * along + off[0] * self.pitch[0] * up
        down = np.broadcast_to(self.pitch[0] * up, source.shape)
        return Vectors(source, middle, self.pitch[1] * along, down, self.rows, self.bins)

    @classmethod
    def of_vectors(cls, vectors: Vectors, tolerance: float = 1e-3) -> Cone:
        """The circular or helical cone that has the same rays as places of source and detector.

        Args:
            vectors: places of source and detector, view by view.
            tolerance: how far the source or a corner of the detector may stand from where the cone
                has it, in bins.

        Raises:
            InputError: a view stands elsewhere; the sentence names the first.
        """
        limit = checked_length("Cone", "tolerance", tolerance)
        angles = np.arctan2(vectors.across[:, 1], vectors.across[:, 0])
        along, ahead = _frame(angles)
        reach = vectors.middle - vectors.source
        pitch = _middle_one(vectors.down[:, 2]), _middle_one((vectors.across * along).sum(axis=1))
        if min(pitch) <= 0:
            raise InputError(
                "Vectors: rows do not grow along z, so no Cone has these rays: turn the images' "
                "rows over, and give down and middle accordingly"
            )
        to_axis = _middle_one(-(vectors.source * ahead).sum(axis=1))
        to_detector = _middle_one((reach * ahead).sum(axis=1))
        offset = _middle_one(reach[:, 2]), _middle_one((reach * along).sum(axis=1))
        counts = vectors.rows, vectors.bins
        center = tuple((n - 1) / 2 - o / p for n, o, p in zip(counts, offset, pitch, strict=True))
        heights = vectors.source[:, 2]
        turned = np.unwrap(angles)
        found = cls(turned, *counts, pitch, to_axis, to_detector, center, heights)
        _check_equal(vectors, found.vectors(), limit * min(pitch))
        return found


def _check_equal(given: Vectors, circular: Vectors, limit: float) -> None:
    off = np.abs(given.source - circular.source).max(axis=1)
    for at, other in zip(given.corners(), circular.corners(), strict=True):
        off = np.maximum(off, np.abs(at - other).max(axis=1))
    if (off > limit).any():
        view = int(np.flatnonzero(off > limit)[0])
        raise InputError(
            f"Vectors: view {view} is not circular: its source or detector stands {off[view]:.3g} "
            f"from where a Cone has it, {limit:.3g} allowed; use the Vectors as they are"
        )


def _frame(angles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors along the rows and from the source to the axis, (views, 3) each."""
    cosine, sine, zero = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    return np.stack([cosine, sine, zero], axis=1), np.stack([-sine, cosine, zero], axis=1)


def _middle_one(values: NDArray[np.float64]) -> float:
    return float(np.median(values))


def _pitch(pitch: Any) -> tuple[float, float]:
    values = real_numbers(pitch)
    if values is None or not np.isfinite(values).all() or not (values > 0).all():
        raise InputError(f"Cone: pitch is {pitch!r}, wanted a positive length, or (row, bin)")
    if values.shape not in ((), (2,)):
        raise ShapeError(f"Cone: pitch is {pitch!r}, wanted one length or two, (row, bin)")
    row, column = np.broadcast_to(values, (2,)).tolist()
    return row, column


def _center(center: Any, rows: int, bins: int) -> tuple[float, float]:
    if center is None:
        return (rows - 1) / 2, (bins - 1) / 2
    values = real_numbers(center)
    if values is None or values.shape != (2,):
        raise ShapeError(f"Cone: center is {center!r}, wanted (row, bin)")
    return checked_center("Cone", values[0]), checked_center("Cone", values[1])


def _heights(heights: Any, views: int) -> NDArray[np.float64]:
    if heights is None:
        values = np.zeros(views)
    else:
        given = real_numbers(heights)
        if given is None or not np.isfinite(given).all():
            raise InputError("Cone: heights are no finite numbers")
        if given.shape != (views,):
            raise ShapeError(
                f"Cone: heights has shape {given.shape}, wanted one for each angle, ({views},)"
            )
        values = given
    values.flags.writeable = False
    return values
