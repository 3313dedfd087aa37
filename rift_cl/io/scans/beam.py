"""Source and detector of a scan, as a file tells them: before views, rows and bins are counted.

Scanners, packages and people write the same few facts in many ways: distances of the source from
the axis and from the detector, the pitch of the detector, where the axis is seen on it; or three
vectors a view. Readers bring them into one of the two forms here, and ``over`` makes a geometry of
them once the projections are known, or says which of the facts cannot be true.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Cone, FanBeam, Vectors
from rift_cl.io.scans.angle_list import AngleList

Geometry: TypeAlias = FanBeam | Cone | Vectors
Floats = NDArray[np.float64]
_Made = TypeVar("_Made")

# Magnifications below this are those of a distant source: a beamline, whose rays are parallel.
PARALLEL_BELOW = 1.01
# A source is so many bins away from the axis at least; nearer, lengths are in two units.
_FEWEST_BINS = 10
# Half of the angle that a detector is seen under from the source; no scanner's is wider.
_WIDEST = math.radians(60)
# A fan that opens by less than this many degrees is no scanner's either.
_NARROWEST = 0.25
# Scans whose source, detector and axis are off a circle by less than this share of a bin are cones.
_CIRCULAR = 0.25


@dataclass(frozen=True, kw_only=True)
class Beam:
    """Source and detector that turn about an axis.

    Args:
        source_to_axis: distance of the source from the rotation axis, in ``unit``.
        source_to_detector: distance of the source from the detector, in ``unit``.
        pitch: distance between rows and between bins on the detector, in ``unit``.
        unit: of length, empty where it is not told.
        offset: rows and bins from the detector's middle to where the orbit plane and the axis are
            seen.
        center: row and bin at which they are seen, where that is told; in place of ``offset``.
        lean: of the axis in the detector's plane, in radians, positive where its bin grows with
            the row.
        heights: of the source in each view, in ``unit``; 0 where none are told.
        curved: bins on an arc about the source.
        shape: rows and bins of the detector, where the file names them.
        angles: of the views, where the file names them.
        white: counts of the beam in the projections, where they were corrected for flats.
        views: number of the projections, where the file names it.
        folder: place of the projections beside the file, where it names one.
        prefix: what the names of the projections' files begin with.
        notes: what was decided, a sentence each.
    """

    source_to_axis: float
    source_to_detector: float
    pitch: tuple[float, float]
    unit: str = ""
    offset: tuple[float, float] = (0.0, 0.0)
    center: tuple[float, float] | None = None
    lean: float = 0.0
    heights: Floats | None = None
    curved: bool = False
    shape: tuple[int, int] | None = None
    angles: AngleList | None = None
    white: float | None = None
    views: int | None = None
    folder: str = ""
    prefix: str = ""
    notes: tuple[str, ...] = ()

    def lean_over(self, rows: int) -> float:
        """``lean`` where it moves the axis by a quarter of a bin or more over so many rows."""
        slope = abs(math.tan(self.lean)) * self.pitch[0] / self.pitch[1]
        return self.lean if slope * (rows - 1) / 2 >= _CIRCULAR else 0.0

    def over(self, path: Path, shape: tuple[int, int, int], angles: Floats) -> Geometry:
        """The geometry of projections: a fan's of one row, otherwise a cone's, its axis upright.

        Args:
            path: the file, for errors.
            shape: (angle, row, bin).
            angles: in radians.

        Raises:
            ShapeError: the detector has other rows and bins than the file names.
            InputError: the lengths are no scanner's.
        """
        _, rows, bins = shape
        _check_detector(path, self.shape, (rows, bins))
        self._check_lengths(path, bins)
        row, bin = self.center or ((rows - 1) / 2 + self.offset[0], (bins - 1) / 2 + self.offset[1])
        lengths = (self.source_to_axis, self.source_to_detector)
        flat_row = rows == 1 and self.heights is None and not self.curved
        if flat_row:
            return _named(path, lambda: FanBeam(*lengths, self.pitch[1], bin))
        _check_seen(path, bin, bins)
        return _named(
            path,
            lambda: Cone(
                angles,
                rows,
                bins,
                self.pitch,
                *lengths,
                center=(row, bin),
                heights=self.heights,
                curved=self.curved,
            ),
        )

    def words(self, geometry: Geometry) -> str:
        """What is told of it in the line about the file."""
        lean = math.degrees(self.lean)
        return beam_words(geometry, self.unit) + (
            f" and leaning by {lean:.3g} degrees" if lean else ""
        )

    def _check_lengths(self, path: Path, bins: int) -> None:
        to_axis, to_detector = self.source_to_axis, self.source_to_detector
        numbers = (to_axis, to_detector, *self.pitch)
        if not all(math.isfinite(number) and number > 0 for number in numbers):
            raise InputError(
                f"{path}: its source is {to_axis:g} from the axis and {to_detector:g} from the "
                f"detector, whose pitch is {self.pitch[0]:g} x {self.pitch[1]:g} (rows, bins): "
                "wanted positive lengths; mend them, or give others with geometry= (--geometry)"
            )
        if to_detector < to_axis:
            raise InputError(
                f"{path}: the detector is {to_detector:g} from the source, and the axis "
                f"{to_axis:g}: the axis would stand behind the detector; are the two swapped, or "
                "is one of them the distance from the axis to the detector? Give others with "
                "geometry= (--geometry)"
            )
        if to_axis < _FEWEST_BINS * max(self.pitch):
            raise InputError(
                f"{path}: the source is {to_axis:g} from the axis and the detector's pitch is "
                f"{max(self.pitch):g}: these look like two units of length; give all lengths in "
                "one with geometry= (--geometry)"
            )
        half = bins * self.pitch[1] / 2 / to_detector
        if (half if self.curved else math.atan(half)) > _WIDEST:
            raise InputError(
                f"{path}: a detector of {bins} bins of {self.pitch[1]:g} at {to_detector:g} from "
                "the source is wider than any scanner's: distances and pitch look like two units "
                "of length; give all in one with geometry= (--geometry)"
            )


@dataclass(frozen=True, kw_only=True)
class ViewVectors:
    """Source and detector of every view by themselves.

    Args:
        source: (view, 3) positions in the order x, y, z, in ``unit``.
        middle: (view, 3) positions of the detector's middle.
        across: (view, 3) from one bin to the next.
        down: (view, 3) from one row to the next.
        unit: of length, empty where it is not told.
        shape: rows and bins of the detector, where the file names them.
        notes: what was decided, a sentence each.
    """

    source: Floats
    middle: Floats
    across: Floats
    down: Floats
    unit: str = ""
    shape: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()
    white: None = None
    folder: str = ""
    prefix: str = ""

    @property
    def views(self) -> int:
        """Number of the projections."""
        return len(self.source)

    def lean_over(self, rows: int) -> float:
        """0: the vectors say how an axis leans."""
        del rows
        return 0.0

    @property
    def pitch(self) -> tuple[float, float]:
        """Distance between rows and between bins, on the average over the views."""
        row, bin = (float(np.linalg.norm(v, axis=1).mean()) for v in (self.down, self.across))
        return row, bin

    @property
    def angles(self) -> AngleList:
        """The directions that the sources stand in."""
        x, y = self.source[:, 0], self.source[:, 1]
        return AngleList("sources", np.unwrap(np.arctan2(x, -y)), unit="radians", computed=True)

    def over(self, path: Path, shape: tuple[int, int, int], angles: Floats) -> Geometry:
        """The geometry of projections: a cone's where the views are on one circle.

        Args:
            path: the file, for errors.
            shape: (angle, row, bin).
            angles: not used; the vectors say all.

        Raises:
            ShapeError: there are more vectors or fewer than views, or another detector.
            InputError: the vectors are no scanner's.
        """
        del angles
        views, rows, bins = shape
        _check_detector(path, self.shape, (rows, bins))
        if views != self.views:
            raise ShapeError(
                f"{path}: there are vectors of {self.views} views, and {views} projections: name "
                "the file that belongs to them with geometry= (--geometry)"
            )
        vectors = _named(
            path,
            lambda: Vectors(self.source, self.middle, self.across, self.down, rows, bins),
        )
        return circular(vectors)

    def words(self, geometry: Geometry) -> str:
        """What is told of it in the line about the file."""
        return beam_words(geometry, self.unit)


AnyBeam: TypeAlias = Beam | ViewVectors


def circular(vectors: Vectors) -> Cone | Vectors:
    """The cone that has the rays of vectors, to a quarter of a bin; themselves if there is none."""
    try:
        return Cone.of_vectors(vectors, tolerance=_CIRCULAR)
    except InputError:
        return vectors


def narrow_words(geometry: Geometry, bins: int) -> tuple[str, ...]:
    """A doubt about lengths that make a detector as narrow from the source as no scanner's."""
    if isinstance(geometry, Vectors):
        width = float(np.median(np.linalg.norm(geometry.across, axis=1)))
        away = float(np.median(np.linalg.norm(geometry.middle - geometry.source, axis=1)))
    else:
        width = geometry.pitch[1] if isinstance(geometry, Cone) else geometry.pitch
        away = geometry.source_to_detector
    opening = math.degrees(2 * math.atan(bins * width / 2 / away))
    if opening >= _NARROWEST:
        return ()
    return (
        f"The fan opens by {opening:.2g} degrees, hardly more than parallel rays: are distances "
        "and pitch in one unit of length (--geometry)?",
    )


def beam_words(geometry: Geometry, unit: str) -> str:
    """A phrase about source and detector."""
    of = f" {unit}" if unit else ""
    if isinstance(geometry, Vectors):
        return f"cone beam by vectors, {geometry.views} views, which are those of no upright cone"
    to_axis, to_detector = geometry.source_to_axis, geometry.source_to_detector
    lengths = (
        f"source {to_axis:.5g}{of} from the axis, detector {to_detector:.5g}{of} from the source, "
        f"magnification {to_detector / to_axis:.4g}"
    )
    if isinstance(geometry, FanBeam):
        return f"fan beam, {lengths}, axis at bin {geometry.center:.2f}"
    row, bin = geometry.center
    curved = "curved detector, " if geometry.curved else ""
    rise = float(np.ptp(geometry.heights))
    moves = "rises" if geometry.heights[-1] >= geometry.heights[0] else "falls"
    helix = f", the source {moves} by {rise:.4g}{of}" if rise else ""
    return (
        f"cone beam, {lengths}, {curved}axis at bin {bin:.2f}, orbit plane at row {row:.2f}{helix}"
    )


def _check_detector(path: Path, named: tuple[int, int] | None, found: tuple[int, int]) -> None:
    if named is None or named == found:
        return
    if named == found[::-1]:
        raise ShapeError(
            f"{path}: the detector has {named[0]} rows of {named[1]} bins, and the projections "
            f"{found[0]} of {found[1]}: rows and bins are swapped; say which axis is which with "
            "axes= (--axes), such as --axes angle,bin,row"
        )
    raise ShapeError(
        f"{path}: the detector has {named[0]} rows of {named[1]} bins, and the projections "
        f"{found[0]} of {found[1]}: they belong to another scan, or were cut or binned; then give "
        "their own geometry with geometry= (--geometry)"
    )


def _check_seen(path: Path, bin: float, bins: int) -> None:
    if not -0.5 <= bin <= bins - 0.5:
        raise InputError(
            f"{path}: the axis would be seen at bin {bin:.1f}, off the detector of {bins} bins: "
            "its offset looks like one in another unit; give others with geometry= (--geometry)"
        )


def _named(path: Path, make: Callable[[], _Made]) -> _Made:
    """A geometry; its errors name the file."""
    try:
        return make()
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error
