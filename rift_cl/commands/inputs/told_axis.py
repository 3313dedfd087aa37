"""The rotation axis by what a person says, a file says and the data say, for slices and fits alike.

The search is that of ``scan_axis``; here is what is made of it: which of the three is followed, by
how much projections are turned, and the sentences that say so.
"""

from __future__ import annotations

import dataclasses
import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.scan_axis import (
    doubted_center,
    doubted_circle,
    doubted_tilt,
    doubted_vectors,
    find_axis,
    settled_axis,
    tilt_worth_turning,
    unsure_tilt,
)
from rift_cl.errors import RiftError
from rift_cl.geometry import Cone, Vectors
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct.axis import AxisEstimate
from rift_cl.reconstruct.axis.search import angle_doubt
from rift_cl.reconstruct.direct.offset_axis import is_full_turn, widest_hole


@dataclass(frozen=True)
class ToldAxis:
    """A rotation axis, and how it is known.

    Args:
        center: its bin on the detector as the file has it; of a tilted axis of parallel rays that
            at the detector's middle row, of a cone's that at the orbit's. None of vectors.
        tilt: degrees by which it leans, and by which projections are to be turned.
        turned: whether the angles run the other way than the file was taken to say.
        record: how it is known, as configurations keep it.
        notes: the same for people, a sentence each.
    """

    center: float | None
    tilt: float
    turned: bool
    record: dict[str, Any]
    notes: tuple[str, ...]


def axis_of_cone(
    scan: ScanFile,
    center: float | None,
    tilt: float | None,
    device: Device | None = None,
    *,
    zingers: float | None = None,
) -> ToldAxis:
    """The axis of a cone, its tilt and the sense of rotation, unless they are said.

    Args:
        scan: the scan; of a cone, or of vectors, which are taken as they are.
        center: bin that a person says (--center).
        tilt: degrees that a person says (--tilt).
        device: as for ``find_axis``.
        zingers: as for ``find_axis``.

    Raises:
        NonFiniteError: a sample is not finite.
    """
    cone, rows, bins = scan.cone, *scan.shape[1:]
    lean = math.degrees(scan.lean) if tilt is None else tilt
    if center is not None:
        doubts = tuple(doubted_circle(scan, center, device, zingers=zingers))
        return ToldAxis(center, lean, False, {"center": center, "by": "--center"}, doubts)
    if not isinstance(cone, Cone):
        doubts = doubted_vectors(scan, cone) if isinstance(cone, Vectors) else ()
        record = {"center": (bins - 1) / 2, "by": "the vectors"}
        return ToldAxis(None, lean, False, record, doubts)
    axis = settled_axis(scan, cone.center[1], device, zingers=zingers)
    notes = axis.notes
    if tilt is None and axis.found is not None:
        # What the file says of the lean is kept, unless the data are sure of another.
        slope = axis.found.slope(lean)
        beyond = dataclasses.replace(axis.found, tilt=axis.found.tilt - slope)
        if tilt_worth_turning(beyond, rows):
            lean = axis.found.degrees(axis.found.tilt)
        notes = (*(() if lean else unsure_tilt(axis.found, rows)), *notes)
    return ToldAxis(axis.center, lean, axis.turned, axis.record, notes)


def unchecked_helix(scan: ScanFile) -> list[str]:
    """What of a helix nothing checks: no opposite rays lie in one plane across the axis."""
    if not isinstance(scan.cone, Cone) or scan.cone.circular:
        return []
    return [
        "The source moves along the axis: the sense of rotation, the sign of the heights and "
        "the place of the axis were taken as given, and not checked against the data."
    ]


def found_in_words(found: AxisEstimate, rows: int, spanned: int, tilt: float | None) -> list[str]:
    """What is said of an axis of parallel rays that was found, and of its tilt.

    Args:
        found: what the data tell.
        rows: of the detector.
        spanned: how many of them lie between the outermost that are taken, these included.
        tilt: degrees that a person says (--tilt), or None.
    """
    leans = unsure_tilt(found, rows) if tilt is None else doubted_tilt(found, spanned, tilt)
    return [f"The rotation axis was found {found.in_words()}.", *leans]


def offset_in_words(center: float, angles: NDArray[np.float64], *, combined: bool) -> str:
    """What is said of a turn whose axis is so far off the detector's middle that it matters.

    Args:
        center: bin of the axis.
        angles: of the views, in radians.
        combined: whether opposite views are weighed to make one; otherwise each is used as it is.
    """
    whole = is_full_turn(angles)
    turn = "a full turn" if whole else "a turn with a hole"
    off = f"The axis, bin {center:.2f}, is off the middle of the detector in {turn}"
    joined = "opposite views were combined, and " if combined else ""
    said = f"{off}: {joined}slices extend to the farther end."
    return said if whole else f"{said} {_hole_of(angles, combined)}"


def hole_in_words(angles: NDArray[np.float64]) -> str:
    """Where views of a turn lack most, in degrees as their angles count them."""
    first, last = (math.degrees(angle) for angle in widest_hole(angles))
    return f"between {first:.4g} and {last:.4g} degrees"


def _hole_of(angles: NDArray[np.float64], combined: bool) -> str:
    """What becomes of a hole in a turn whose axis is off the middle."""
    lacking = f"There is no view {hole_in_words(angles)}"
    if combined:
        return f"{lacking}: those beside them stand for what is missing."
    return (
        f"{lacking}: what they alone would show of the part beyond the detector's nearer end is "
        "less certain."
    )


def doubted_parallel(
    scan: ScanFile,
    line: NDArray[np.float32],
    center: float | None,
    tilt: float,
    *,
    away: float,
    spanned: int,
    device: Device | None = None,
    zingers: float | None = None,
) -> list[str]:
    """What data of parallel rays have against their angles, and an axis that a person says.

    Args:
        scan: the scan.
        line: line integrals of the middle one of the rows that are taken, (angle, bin).
        center: bin that a person says (--center); None where there is one for each row.
        tilt: degrees by which projections are turned; 0 where they are not.
        away: rows by which that row is beyond the detector's middle one.
        spanned: as for ``found_in_words``.
        device: as for ``find_axis``.
        zingers: as for ``find_axis``.
    """
    found = None
    if center is not None:
        with suppress(RiftError):  # data that do not tell the axis have nothing against one
            found = find_axis(scan, device, zingers=zingers)
    doubt = angle_doubt(line, scan.angles) if found is None else found.doubt
    doubts = [f"Doubt: {doubt}."] if doubt else []
    if found is None or center is None:
        return doubts
    leans = doubted_tilt(found, spanned, tilt)
    return doubts + doubted_center(_at_row(found, tilt, away), center) + leans


def _at_row(found: AxisEstimate, tilt: float, away: float) -> AxisEstimate:
    """What the data tell of a row away from the middle one, for the middle of the detector."""
    slope = found.tilt if found.tilt_is_sure else 0.0
    moved = (slope - found.slope(tilt)) * away
    center, low, high = (place + moved for place in (found.center, *found.interval))
    return dataclasses.replace(found, center=center, interval=(low, high))
