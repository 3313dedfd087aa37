"""The rotation axis of a scan in a file: one search for every command, so that all say the same."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import open_device
from rift_cl.commands.inputs.axis_alignment import Alignment
from rift_cl.commands.inputs.scan_rows import read_attenuation
from rift_cl.commands.options import MOST_TILT
from rift_cl.errors import InputError, RiftError
from rift_cl.geometry import Cone, Fan, Vectors
from rift_cl.geometry.nearly_upright import nearly_upright
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct.axis import AxisEstimate, axis_of_stack
from rift_cl.reconstruct.axis.circular import axis_of_fan, axis_of_scan, orbit_rows
from rift_cl.reconstruct.axis.fan_doubt import sense_doubt
from rift_cl.reconstruct.axis.lying_axis import looked_at, lying_axis
from rift_cl.reconstruct.axis.search import GIVE_IT
from rift_cl.reconstruct.preprocess import remove_zingers

Floats = NDArray[np.float32]
# Line integrals (angle, row, bin) from a row to the one before another.
RowReader = Callable[[int, int], Floats]
# Rows above and below that tell whether a pixel stands out.
ZINGER_HALO = 1

# A tilt is turned where it moves the axis by so many bins between the middle row and the first; one
# that is not sure is told from so many times its standard error.
_TILT_MATTERS, _TOLD = 0.25, 2.0
# By how many bins an interval may miss an axis that was given before that is worth a doubt.
_NEAR = 0.5
# Transmission below this share of the median tells nothing more.
_LEAST_LIGHT = 1e-3


def find_axis(
    scan: ScanFile,
    device: Device | None = None,
    *,
    span: tuple[float, float] | None = None,
    zingers: float | None = None,
    rows: tuple[int, int] | None = None,
) -> AxisEstimate:
    """Find the rotation axis of a scan.

    Reads a few rows, of a cone those next to the source's orbit, else evenly spread over the whole
    detector whichever of them are wanted as slices; where these show air, and so tell no axis, a
    few that show the object, among those that are wanted. It uses their line integrals as they
    are, less zingers where they are to be removed: rings do not turn with the object, so that they
    contradict every centre alike.

    Args:
        scan: the scan.
        device: where rows of a detector that leans are turned upright and zingers are removed; the
            default one if not given. The search itself runs on the host.
        span: first and last bin between which to search; as for ``find_center`` if not given.
        zingers: standard deviations from which on a pixel is one; None where they stay.
        rows: the first row that is wanted and the one after the last; all if not given.

    Raises:
        InputError: the data do not tell the axis; the sentence names the file and says why.
        NonFiniteError: a sample is not finite.
    """
    geometry = scan.geometry
    read = partial(_read_rows, scan, zingers, device)
    try:
        if scan.cone is not None:
            return replace(_of_cone(scan, scan.cone, span, device, read), aspect=scan.aspect)
        if isinstance(geometry, Fan):
            row = scan.shape[1] // 2
            return axis_of_scan(read(row, row + 1)[:, 0], geometry, span)
        count = scan.shape[1]
        look = partial(_integrals_but_flats, scan)
        found = axis_of_stack(
            lambda row: read(row, row + 1)[:, 0], look, count, scan.angles, span, rows
        )
        return replace(found, aspect=scan.aspect)
    except InputError as error:
        if str(error).startswith(f"{scan.path}: "):
            raise  # of the file itself, which says so
        raise type(error)(f"{scan.path}: {error}") from error


def _read_rows(
    scan: ScanFile, zingers: float | None, device: Device | None, start: int, stop: int
) -> Floats:
    """Line integrals of some rows, (angle, row, bin), of which zingers are removed if asked for."""
    if zingers is None:
        return read_attenuation(scan, start, stop).projections
    first, last = max(0, start - ZINGER_HALO), min(scan.shape[1], stop + ZINGER_HALO)
    rows = read_attenuation(scan, first, last).projections
    dark = scan.kind == "attenuation"
    clean, _ = remove_zingers(rows, sigma=zingers, dark=dark, kind="attenuation", device=device)
    return clean[:, start - first : stop - first]


@dataclass(frozen=True)
class SettledAxis:
    """The axis of a fan or of a cone: as the data tell it, or else as the file has it.

    Args:
        center: its bin on the detector as the file has it.
        turned: whether the data say that the angles run the other way than the file's.
        found: what the search found; None where the data do not tell.
        record: how it is known, as configurations keep it.
        notes: the same for people, a sentence each.
    """

    center: float
    turned: bool
    found: AxisEstimate | None
    record: dict[str, Any]
    notes: tuple[str, ...]


def settled_axis(
    scan: ScanFile, center: float, device: Device | None = None, *, zingers: float | None = None
) -> SettledAxis:
    """Find the axis and the sense of rotation of a fan or a cone, and say what is done.

    Args:
        scan: the scan.
        center: bin of the axis that its file tells, or that is assumed.
        device: as for ``find_axis``.
        zingers: as for ``find_axis``.

    Raises:
        NonFiniteError: a sample is not finite.
    """
    middle = center == (scan.shape[2] - 1) / 2
    told = "the detector's middle" if middle else "the file"
    try:
        found = find_axis(scan, device, zingers=zingers)
    except InputError as error:
        reason = str(error).removeprefix(f"{scan.path}: ").replace(GIVE_IT, "")
        note = (
            f"The axis was taken to be that of {told}, bin {center:.2f} (--center), since the data "
            f"do not tell it: {reason}."
        )
        return SettledAxis(center, False, None, {"center": center, "by": told}, (note,))
    says = f"{told} {'is' if middle else 'says'} bin {center:.2f}"
    words = f"The rotation axis was found {found.in_words()}; {says}."
    notes: tuple[str, ...] = (words,)
    turned = found.sense is not None and found.sense.sign < 0
    if turned:
        reason = (
            "The angles were therefore taken with the other sign; --reversed does so without "
            "asking the data, and --center leaves them as they are."
        )
        notes = (*notes, reason)
    return SettledAxis(found.center, turned, found, found.record(), notes)


def doubted_center(found: AxisEstimate, given: float) -> list[str]:
    """A doubt where data tell another axis than a person does.

    Args:
        found: what the data tell.
        given: the bin that was given (--center).
    """
    low, high = found.interval
    if low - _NEAR <= given <= high + _NEAR:
        return []
    away = found.center - given
    return [
        f"Doubt: the data tell the axis at bin {found.center:.2f} ({low:.2f} to {high:.2f}), "
        f"{abs(away):.2f} bins {'above' if away > 0 else 'below'} --center {given:g}; without "
        "--center it is looked for."
    ]


def doubted_circle(
    scan: ScanFile, given: float, device: Device | None = None, *, zingers: float | None = None
) -> list[str]:
    """What the data of a fan or a cone have against their geometry and an axis that was given.

    Data that cannot be read here, or do not tell the axis, have nothing against one.
    """
    try:
        found = find_axis(scan, device, zingers=zingers)
    except RiftError:
        return []
    doubts = [f"Doubt: {found.doubt}."] if found.doubt else []
    return doubts + doubted_center(found, given)


def doubted_vectors(scan: ScanFile, vectors: Vectors) -> tuple[str, ...]:
    """What the data have against the sense of rotation of vectors that nearly are a cone's.

    Vectors are taken as they are; a sentence says that images or vectors are mirrored.

    Raises:
        NonFiniteError: a sample is not finite.
    """
    found = nearly_upright(vectors)
    if found is None:
        return ()
    cone, turned_over, mirrored = found
    row = round(min(max(cone.center[0], 0), cone.rows - 1))
    row = cone.rows - 1 - row if turned_over else row
    line = read_attenuation(scan, row, row + 1).projections[:, 0]
    doubt = sense_doubt(line[:, ::-1] if mirrored else line, cone.fan())
    if not doubt:
        return ()
    return (
        f"{doubt}: the images are mirrored, or the vectors are. They were taken as they are; turn "
        "the images, or mend the vectors (--geometry).",
    )


def tilt_worth_turning(estimate: AxisEstimate, rows: int) -> float:
    """The tilt that was found, in degrees, where it is sure and moves the axis; else 0."""
    turns = estimate.tilt_is_sure and _moves(estimate, rows)
    return estimate.degrees(estimate.tilt) if turns else 0.0


def unsure_tilt(estimate: AxisEstimate, rows: int) -> list[str]:
    """What is told of a tilt that would matter, and is not sure enough to turn projections."""
    told = abs(estimate.tilt) > _TOLD * estimate.tilt_error and _moves(estimate, rows)
    if estimate.tilt_is_sure or not told:
        return []
    tilt, error = (estimate.degrees(slope) for slope in (estimate.tilt, estimate.tilt_error))
    does_so = f" (--tilt {tilt:.2g} does so)" if abs(tilt) <= MOST_TILT else ""
    return [
        f"The rows' axes lie about a line that tilts by {tilt:.2g} +- {error:.2g} degrees, from "
        f"which they scatter {estimate.scatter:.2g} times as much as their errors explain: "
        f"projections were not turned by it{does_so}."
    ]


def doubted_tilt(estimate: AxisEstimate, rows: int, given: float) -> list[str]:
    """A doubt where the rows' axes lean otherwise than a person says, so that slices blur.

    Args:
        estimate: what the data tell.
        rows: of the detector that slices are made of.
        given: degrees by which projections are turned; 0 where they are not.
    """
    other = replace(estimate, tilt=estimate.tilt - estimate.slope(given))
    # The scatter about the line is that of what was found.
    surely = abs(other.tilt) > estimate.times_sure * estimate.tilt_error
    if not (surely and _moves(other, rows)):
        return []
    tilt, error = (estimate.degrees(slope) for slope in (estimate.tilt, estimate.tilt_error))
    said = f"--tilt {given:g}" if given else "without --tilt"
    most = abs(other.tilt) * (rows - 1) / 2
    return [
        f"Doubt: the rows' axes lean by {tilt:.2f} +- {error:.2f} degrees, and projections were "
        f"turned by {given:g} ({said}): the axis is {most:.2g} bins off in the outermost slices."
    ]


def _moves(estimate: AxisEstimate, rows: int) -> bool:
    return abs(estimate.tilt) * (rows - 1) / 2 >= _TILT_MATTERS


def _of_cone(
    scan: ScanFile,
    cone: Cone | Vectors,
    span: tuple[float, float] | None,
    device: Device | None,
    read_rows: RowReader,
) -> AxisEstimate:
    if not isinstance(cone, Cone) or not cone.circular:
        raise InputError(
            "the axis is found from sources on one circle, and these are on none: the geometry "
            "must tell it (--geometry)"
        )
    groups = orbit_rows(cone)
    first, stop = int(groups[0][0]), int(groups[-1][-1]) + 1
    read = _put_upright(scan, cone, first, stop, device, read_rows)
    rows = np.stack([read[:, group - first].mean(axis=1) for group in groups], axis=1)
    places = np.array([group.mean() for group in groups])
    lying = lying_axis(_integrals_but_flats(scan, *looked_at(cone)), cone)
    found = axis_of_fan(rows, places, cone.center[0], cone.fan(), span, lying)
    slope = math.tan(scan.lean) * scan.aspect
    centers = found.centers + slope * (found.rows - cone.center[0])
    return replace(found, tilt=found.tilt + slope, centers=centers)


def _put_upright(
    scan: ScanFile, cone: Cone, first: int, stop: int, device: Device | None, read_rows: RowReader
) -> Floats:
    """Line integrals of some rows, turned where the file says that the axis leans.

    A row of a detector that leans sees the object's lower part at one end and its upper one at the
    other, which moves the axis that opposite rays tell.
    """
    if not scan.lean:
        return read_rows(first, stop)
    row, bin = cone.center
    turn = Alignment(bin, row, scan.lean, aspect=scan.aspect)
    halo = turn.halo(cone.bins)
    start = max(0, first - halo)
    around = read_rows(start, min(scan.shape[1], stop + halo))
    return turn.aligned(around, start, slice(first - start, stop - start), device or open_device())


def _integrals_but_flats(scan: ScanFile, views: list[int], rows: list[int]) -> NDArray[np.float32]:
    """Line integrals of some rows of some views, but for what all views have in common."""
    values = scan.rows.look("projections", views, rows)
    if scan.kind == "attenuation":
        return values
    least = max(_LEAST_LIGHT * float(np.median(values)), float(np.finfo(np.float32).tiny))
    integrals: NDArray[np.float32] = -np.log(np.maximum(values, np.float32(least)))
    return integrals
