"""RTK's circular geometry as a scan, and back.

    geometry = rtk.ThreeDCircularProjectionGeometry.New()
    views, pitch = to_rtk(scan)
    for view in views:
        geometry.AddProjection(*view)
    scan = from_rtk(geometry, rows, bins, pitch)

The middle of RTK's projections is taken to be at 0, as of an image with the origin
``-(n - 1) / 2 * spacing``. Projections pass as they are, (angles, rows, bins); a volume of ours is
RTK's as ``volume.transpose(1, 0, 2)[::-1]``, and the other way ``volume[::-1].transpose(1, 0, 2)``,
since RTK's axis of rotation is y. RTK itself is not needed. RTK consumes its inputs in place.

Source: "3D Circular Projection Geometry" of the Reconstruction Toolkit.
"""

from __future__ import annotations

from typing import Any

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Vectors
from rift_cl.geometry.rtk_views import RtkView, rtk_of_vectors, vectors_of_rtk
from rift_cl.interop.circular import circular, number_of, places

__all__ = ["from_rtk", "to_rtk"]

# AddProjection's arguments in its order, and where RTK keeps them, those in radians first.
_ORDER = (3, 4, 0, 7, 8, 1, 2, 5, 6)
_ANGLES = ("GetGantryAngles", "GetOutOfPlaneAngles", "GetInPlaneAngles")
_LENGTHS = (
    "GetSourceToIsocenterDistances",
    "GetSourceToDetectorDistances",
    "GetSourceOffsetsX",
    "GetSourceOffsetsY",
    "GetProjectionOffsetsX",
    "GetProjectionOffsetsY",
)


def from_rtk(
    geometry: Any, rows: int, bins: int, pitch: float | tuple[float, float]
) -> Cone | Vectors:
    """Read RTK's geometry.

    Args:
        geometry: a ``ThreeDCircularProjectionGeometry``, or a sequence of ``AddProjection``'s nine
            arguments a view (distances to the axis and to the detector, gantry angle, offsets of
            the projection x and y, out-of-plane and in-plane angle, offsets of the source x and y;
            degrees).
        rows: number of rows of the detector.
        bins: number of bins in a row.
        pitch: spacing of the projections, one number or (row, bin).

    Returns:
        A ``Cone`` where source and detector turn on a circle or a helix; else ``Vectors``.

    Raises:
        InputError: the detector is curved, or the numbers are none.
    """
    radius = getattr(geometry, "GetRadiusCylindricalDetector", lambda: 0.0)()
    if radius:
        raise InputError("RTK: the detector is curved, vectors describe flat ones alone")
    views = _views(geometry)
    both = pitch if isinstance(pitch, tuple) else (pitch, pitch)
    size = number_of("RTK", "pitch", both[0]), number_of("RTK", "pitch", both[1])
    source, middle, across, down = vectors_of_rtk(views, size)
    return circular(Vectors(source, middle, across, down, rows, bins))


def to_rtk(scan: Cone | Vectors) -> tuple[list[tuple[float, ...]], tuple[float, float]]:
    """Describe a scan for RTK.

    Args:
        scan: a cone with a flat detector, or vectors whose rows and bins are perpendicular.

    Returns:
        The arguments of ``AddProjection`` for each view, and the spacing of the projections,
        (row, bin).

    Raises:
        InputError: RTK has no words for the detector.
    """
    views, pitch = rtk_of_vectors(places(scan))
    return [tuple(view[k] for k in _ORDER) for view in views], pitch


def _views(geometry: Any) -> list[RtkView]:
    if hasattr(geometry, _ANGLES[0]):
        angles = [[57.29577951308232 * a for a in getattr(geometry, n)()] for n in _ANGLES]
        lengths = [list(getattr(geometry, name)()) for name in _LENGTHS]
        return [RtkView(*numbers) for numbers in zip(*angles, *lengths, strict=True)]
    views = []
    for arguments in geometry:
        given = [number_of("RTK", "a number of a view", value) for value in arguments]
        if not 3 <= len(given) <= len(_ORDER):
            raise InputError(f"RTK: a view has {len(given)} numbers, wanted 3 to {len(_ORDER)}")
        numbers = [0.0] * len(_ORDER)
        for place, value in zip(_ORDER, given, strict=False):
            numbers[place] = value
        views.append(RtkView(*numbers))
    if not views:
        raise InputError("RTK: the geometry has no view")
    return views
