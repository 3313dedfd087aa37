"""One contract for what a file holds: readers find arrays, and here it is settled what they are.

Readers know where a format keeps projections, flats, darks and angles. What the values are, whether
the flats belong to them, and the line that a person reads about it are the same for all formats,
and so is the rule: what is said counts before what the layout prescribes, that before what the
values look like, and what remains doubtful is refused with the option that settles it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, NonFiniteError
from rift_cl.geometry import FanBeam
from rift_cl.io.scans.axes import words
from rift_cl.io.scans.beam import AnyBeam, Geometry, ViewVectors, narrow_words
from rift_cl.io.scans.kind import (
    INTEGRAL,
    Sample,
    named_kind,
    possible_kinds,
    sample,
    sampled,
    spread,
)
from rift_cl.io.scans.literals import Kind
from rift_cl.io.scans.scan_file import RowSource, ScanFile, ScanRequest, pitch_words

# What ``flats`` may say in place of a name.
AIR, MEAN = "air", "mean"
# What takes their place by itself: the beam's counts that a scanner wrote down.
_WHITE = "white"
# Pitches of a scan and of its geometry that differ by no more than this share are in one unit.
_ALIKE = 0.01
# Bins at each end that are taken for air, as a share of the detector.
_AIR_SHARE = 0.02
# Rows over which the mean of a view is taken.
_MEAN_ROWS = 16
# Air at the ends of counts is at least this share of the brightest; projections are at most so many
# times as bright as flats, and flats at most so many times as bright as projections.
_AIR_LEAST, _BRIGHTER, _DIMMER = 0.7, 2.0, 20.0
# Counts below zero by this share of the brightest are no noise about the darks.
_BELOW = 0.25
# Line integrals above this let nothing through that a detector could count: exp(-20) is 2e-9. Those
# whose least is so many times their greatest below zero have the other sign.
_OPAQUE, _NEGATIVE = 20.0, 3.0
# Arrays that are named in a sentence at most.
_MOST_UNUSED = 4
# Bins differ from their neighbours by at most this share where the beam is taken from the ends.
_UNEVEN = 0.05
_KINDS = "--kind counts, transmission or attenuation"


@dataclass(frozen=True, eq=False, kw_only=True)
class Finding:
    """A scan that was found in a file, before it is settled what its values are.

    Args:
        path: the file, or the folder of files.
        source: the layout that was recognised.
        name: the projections, as they are called in a sentence.
        shape: (angle, row, bin).
        axes: letters of the axes as they are stored.
        dtype: type of the values as they are stored.
        rows: reads the rows; a dataclass with the fields ``flats`` and ``darks``.
        angles: in radians.
        angle_words: what is told of them.
        flats: number of flats; 0 for none.
        darks: number of darks; 0 for none.
        evidence: names and units that may state the kind, the weightiest first.
        kind: the kind where the layout prescribes it.
        flats_at: see ``ScanFile``.
        pitch, row_pitch, unit, fan, background, notes: as in ``ScanFile``.
        beam: source and detector as a file tells them, where rays diverge; in place of ``fan``.
        unused: names of arrays of the projections' rows and bins that are no part of the scan.
        contents: a phrase that lists what else the file holds, or nothing.
        advice: for formats whose values tell nothing of their kind, what to do about it; counts
            without flats are then divided by the mean of each view.
    """

    path: Path
    source: str
    name: str
    shape: tuple[int, int, int]
    axes: str
    dtype: np.dtype[np.generic]
    rows: Any
    angles: NDArray[np.float64]
    angle_words: str
    flats: int = 0
    darks: int = 0
    evidence: tuple[str, ...] = ()
    kind: Kind | None = None
    flats_at: NDArray[np.float64] | None = None
    pitch: float | None = None
    row_pitch: float | None = None
    unit: str = ""
    fan: FanBeam | None = None
    beam: AnyBeam | None = None
    background: int = 0
    notes: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    contents: Callable[[], str] = str
    advice: str = ""


def scan_of(found: Finding, request: ScanRequest) -> ScanFile:
    """Settle what the values of a scan are, and describe it.

    Raises:
        InputError: that is doubtful, or what was asked for does not fit the file.
        NonFiniteError: no value that was looked at is finite.
    """
    if request.reversed:
        found = _reversed(found)
    geometry = None
    if found.beam is not None:
        geometry = found.beam.over(found.path, found.shape, found.angles)
        notes = (*found.notes, *found.beam.notes)
        row_pitch, pitch = found.beam.pitch
        unit = found.beam.unit or _unit_beside(found, pitch)
        found = replace(found, pitch=pitch, row_pitch=row_pitch, unit=unit, notes=notes)
    beam = geometry or found.fan
    if beam is not None:
        found = replace(found, notes=(*found.notes, *narrow_words(beam, found.shape[2])))
    if not request.values:
        return _unseen(found, geometry)
    seen = sample(found.rows, found.shape, found.dtype)
    substitute = request.flats if request.flats in (AIR, MEAN) and not found.flats else None
    if found.advice and request.kind == "counts":
        substitute = substitute or MEAN
    if request.flats is None and _has_white(found, request, seen):
        substitute = _WHITE
    if found.flats or substitute is not None or request.kind == "counts":
        _check_signs(found, request, seen)
    kind, notes = _kind(found, request, seen, substitute)
    rows: RowSource = found.rows
    flats, darks = found.flats, found.darks
    if kind != "counts" and (flats or darks):
        rows = replace(found.rows, flats=None, darks=None)
        flats = darks = 0
    background, incident = found.background, None
    if kind == "counts" and substitute == AIR:
        background = _air(found, seen)
    if kind == "counts" and substitute == MEAN:
        incident = _means(found, rows)
    if kind == "counts" and substitute == _WHITE:
        incident = _white(found, seen)
    notes += _doubts(found, kind, seen, calibrated=bool(flats and darks))
    calibration = _calibration(found, kind, substitute, flats, darks)
    line = _line(found, kind, seen, calibration, geometry)
    return ScanFile(
        path=found.path,
        shape=found.shape,
        angles=found.angles,
        pitch=found.pitch,
        unit=found.unit,
        kind=kind,
        source=found.source,
        rows=rows,
        row_pitch=found.row_pitch,
        **_rays(found, geometry),
        background=background,
        notes=(line, *found.notes, *notes),
        flats_at=found.flats_at if flats else None,
        incident=incident,
    )


def _reversed(found: Finding) -> Finding:
    """The scan with its angles in the other sense.

    Raises:
        InputError: it is described by vectors.
    """
    if isinstance(found.beam, ViewVectors):
        raise InputError(f"{found.path}: vectors say how the object turned: leave --reversed out")
    angles = -found.angles
    angles.flags.writeable = False
    return replace(found, angles=angles, angle_words=f"{found.angle_words}, in the other sense")


def _rays(found: Finding, geometry: Geometry | None) -> dict[str, Any]:
    if geometry is None or isinstance(geometry, FanBeam):
        return {"fan": found.fan if geometry is None else geometry}
    assert found.beam is not None
    return {"cone": geometry, "lean": found.beam.lean_over(found.shape[1])}


def _unit_beside(found: Finding, pitch: float) -> str:
    """The unit that the scan has beside a geometry without one, unless its pitch is another."""
    alike = found.pitch is None or math.isclose(found.pitch, pitch, rel_tol=_ALIKE)
    return found.unit if alike else ""


def _unseen(found: Finding, geometry: Geometry | None) -> ScanFile:
    """A scan whose values nobody wants."""
    line = f"{found.path.name}: {found.dtype.name}; {_geometry(found, geometry)}."
    return ScanFile(
        path=found.path,
        shape=found.shape,
        angles=found.angles,
        pitch=found.pitch,
        unit=found.unit,
        kind=found.kind or "counts",
        source=found.source,
        rows=found.rows,
        row_pitch=found.row_pitch,
        **_rays(found, geometry),
        background=found.background,
        notes=(line, *found.notes),
        flats_at=found.flats_at,
    )


def _kind(
    found: Finding, request: ScanRequest, seen: Sample, substitute: str | None
) -> tuple[Kind, tuple[str, ...]]:
    """What the values are, and what had to be passed over to say so."""
    if request.kind in ("transmission", "attenuation"):
        if request.flats is not None:
            raise InputError(
                f"{found.path}: --flats is about counts, and --kind {request.kind} was given: give "
                "one of them"
            )
        return request.kind, _passed_over(found, request.kind)
    if request.kind == "counts" or substitute is not None:
        if not found.flats and substitute is None:
            raise InputError(_wants_flats(found, seen))
        return "counts", ()
    if found.flats:
        beam = _level(found, "flats")
        dark = _level(found, "darks") if found.darks else 0.0
        doubt = _no_counts_of(found, seen, beam, dark)
        if doubt is None:
            return "counts", _few_bright(found, seen, beam, dark)
        if request.flats is not None or possible_kinds(seen) == ("counts",):
            raise InputError(
                f"{found.path}: {doubt}; name other flats with flats= (--flats), or say what the "
                f"values are with kind= ({_KINDS})"
            )
        kind = _by_values(found, seen)
        return kind, (f"The flats are not used: {doubt}.",)
    return found.kind or _by_values(found, seen), _passed_over(found, "")


def _check_signs(found: Finding, request: ScanRequest, seen: Sample) -> None:
    """Refuse what may be counts and lies so far below zero that its type must be wrong."""
    if request.kind in ("transmission", "attenuation") or found.dtype.kind != "i":
        return
    if seen.low < -_BELOW * max(seen.high, 0):
        raise InputError(
            f"{found.path}: {found.name} ({seen}) holds counts far below zero, as unsigned numbers "
            f"do that were stored as signed ones: store it as u{found.dtype.name}, or say what "
            "else the values are with kind= (--kind transmission or attenuation)"
        )


def _passed_over(found: Finding, kind: str) -> tuple[str, ...]:
    if kind and found.flats:
        return (f"The flats are not used: the values are said to be {kind}.",)
    if found.darks and not found.flats:
        return ("The darks are not used, as there are no flats.",)
    return ()


def _doubts(found: Finding, kind: Kind, seen: Sample, *, calibrated: bool) -> tuple[str, ...]:
    """What values, and arrays beside them, have against what the scan was taken to be."""
    if kind == "counts":
        unused = _unused(found) if found.unused and not calibrated else ()
        return _underflow(found, seen) + unused
    if found.kind is not None:
        return ()
    return _impossible(seen) if kind == "attenuation" else ()


def _impossible(seen: Sample) -> tuple[str, ...]:
    """A doubt, where values cannot be line integrals as they are."""
    if seen.high > _OPAQUE:
        return (
            f"Doubt: line integrals reach {seen.high:.4g}, and no X-rays pass more than about "
            f"{_OPAQUE:g}: values that were multiplied, as absorbance times 1000, make densities "
            "wrong by the same factor; divide them first.",
        )
    if seen.middle < 0 and -seen.low > _NEGATIVE * max(seen.high, 0):
        return (
            f"Doubt: most line integrals are negative ({seen.low:.4g} to {seen.high:.4g}), as "
            "logarithms of transmission are whose sign was not changed: densities are negative "
            "as well; change the sign first.",
        )
    return ()


def _unused(found: Finding) -> tuple[str, ...]:
    """What else there is of the size of a frame, where flats or darks are missing."""
    listed = ", ".join(map(repr, found.unused[:_MOST_UNUSED]))
    many = len(found.unused) > 1
    return (
        f"{listed} {'hold' if many else 'holds'} frames of the size of the projections' and "
        f"{'were' if many else 'was'} not used: name flats and darks (--flats, --darks).",
    )


def _by_values(found: Finding, seen: Sample) -> Kind:
    """The kind that names and values agree on.

    Raises:
        InputError: they do not, leave a doubt, or say counts.
    """
    possible = possible_kinds(seen)
    stated = named_kind(found.evidence)
    if found.advice:
        raise InputError(f"{found.path}: {found.advice}")
    if stated is not None and (stated in possible or stated == "counts"):
        possible = (stated,)
    elif stated is not None:
        raise InputError(
            f"{found.path}: {found.name} states {stated}, and its values ({seen}) look like "
            f"{' or '.join(possible)}: say what they are with kind= ({_KINDS})"
        )
    if possible == ("counts",):
        raise InputError(_wants_flats(found, seen))
    if len(possible) > 1:
        left, right = seen.ends
        raise InputError(
            f"{found.path}: {found.name} ({seen}; {left:.4g} and {right:.4g} at the ends of the "
            f"detector) may be {' or '.join(possible)}: say which with kind= ({_KINDS})"
        )
    return possible[0]


def _wants_flats(found: Finding, seen: Sample) -> str:
    listed = found.contents()
    return (
        f"{found.path}: {found.name} ({seen}) holds counts, and there are no flats: name the "
        "frames without the sample with flats= (--flats), or give --flats air where the bins at "
        "both ends of the detector see nothing but air; if these are no counts, say --kind "
        f"transmission or --kind attenuation{f'; {listed}' if listed else ''}"
    )


def _no_counts_of(found: Finding, seen: Sample, bright: float, dark: float) -> str | None:
    """Why flats cannot be those of the projections, or None.

    Args:
        found: the scan.
        seen: values of its projections.
        bright: how bright the flats are.
        dark: how bright the darks are; 0 without any.
    """
    beam = bright - dark
    if not beam > 0:
        # Where projections are no brighter either, rows say so when they are corrected.
        dim = f"the flats, {bright:.4g}, are no brighter than the darks, {dark:.4g}"
        return dim if seen.high > dark else None
    if not seen.whole and seen.high <= min(beam / _DIMMER, INTEGRAL):
        return (
            f"{found.name} ({seen}) is far below the flats' {bright:.4g}, as data are that were "
            "divided by flats before"
        )
    if seen.bright - dark > _BRIGHTER * beam and not seen.wrapped:
        return (
            f"{found.name} ({seen}) is more than {_BRIGHTER:g} times as bright as the flats, "
            f"{bright:.4g}, in too many places for zingers and stuck pixels"
        )
    return None


def _few_bright(found: Finding, seen: Sample, bright: float, dark: float) -> tuple[str, ...]:
    """A doubt about single values that no beam explains; arguments as for ``_no_counts_of``."""
    # Flats no brighter than the darks are told by whoever divides by them.
    if seen.wrapped or bright <= dark or seen.high - dark <= _BRIGHTER * (bright - dark):
        return ()
    return (
        f"Doubt: a few values of {found.name} ({seen}) are more than {_BRIGHTER:g} times as bright "
        f"as the flats, {bright:.4g}: zingers, which --zingers 6 takes out, or stuck pixels.",
    )


def _underflow(found: Finding, seen: Sample) -> tuple[str, ...]:
    """A doubt about numbers below zero that were stored without a sign."""
    if not seen.wrapped:
        return ()
    return (
        f"Doubt: {found.name} ({seen}) holds values near the largest that {seen.dtype.name} takes "
        "between others near zero, as numbers below zero become without a sign (underflow): "
        "subtract darks in signed numbers or in floating point, or give the counts as they were "
        "and --darks.",
    )


def _level(found: Finding, part: str) -> float:
    """How bright flats or darks are: the brightest that is no exception."""
    count = found.flats if part == "flats" else found.darks
    rows = spread(found.shape[1], 3)
    values = found.rows.look(part, spread(count, 2), rows)
    return sampled(values, found.dtype).high


def _air(found: Finding, seen: Sample) -> int:
    """Bins at each end that are taken for air, which must be about as bright as anything."""
    if min(seen.ends) < _AIR_LEAST * seen.high:
        left, right = seen.ends
        raise InputError(
            f"{found.path}: --flats air wants air at both ends of the detector, where {found.name} "
            f"has {left:.4g} and {right:.4g} of {seen.high:.4g} at most: name the flats (--flats), "
            "or take the beam to be each view's mean (--flats mean)"
        )
    uneven = _unevenness(found)
    if uneven > _UNEVEN:
        raise InputError(
            f"{found.path}: --flats air wants an even beam, and bins of {found.name} differ from "
            f"their neighbours by {uneven:.0%} in all views: name the flats (--flats)"
        )
    return max(1, round(_AIR_SHARE * found.shape[2]))


def _unevenness(found: Finding) -> float:
    """Standard deviation of a bin's response about its neighbours', which all views share."""
    views, rows = spread(found.shape[0], 9), spread(found.shape[1], 1)
    lines = found.rows.look("projections", views, rows)[:, 0].astype(np.float64)
    if found.darks:
        lines -= found.rows.look("darks", range(min(found.darks, 9)), rows)[:, 0].mean(axis=0)
    logs = np.log(np.maximum(lines, 1e-3 * np.abs(lines).max() + 1e-30))
    bumps = np.median(logs[:, 1:-1] - (logs[:, :-2] + logs[:, 2:]) / 2, axis=0)
    # Of three bins, of which two count by half: the variance is 1.5 times that of one.
    return float(np.std(bumps) / np.sqrt(1.5)) if bumps.size else 0.0


def _means(found: Finding, rows: RowSource) -> NDArray[np.float64]:
    """The mean of each view, less that of the darks, over a few rows."""
    some = spread(found.shape[1], _MEAN_ROWS)
    views, _, bins = found.shape
    step = max(1, (1 << 22) // (len(some) * bins))
    means = np.empty(views)
    for start in range(0, views, step):
        chosen = range(start, min(start + step, views))
        means[start : start + step] = rows.look("projections", chosen, some).mean(
            axis=(1, 2), dtype=np.float64
        )
    if found.darks:
        means -= float(rows.look("darks", range(found.darks), some).mean(dtype=np.float64))
    bad = np.flatnonzero(~(np.isfinite(means) & (means > 0)))
    if bad.size:
        raise NonFiniteError(
            f"{found.path}: the mean of view {bad[0]} is {means[bad[0]]:g}, wanted a positive "
            "number to take for the beam (--flats mean)"
        )
    means.flags.writeable = False
    return means


def _has_white(found: Finding, request: ScanRequest, seen: Sample) -> bool:
    """Whether the beam is a number that the scanner wrote down, and the values are counts."""
    if found.beam is None or found.beam.white is None or found.flats:
        return False
    if request.kind is not None:
        return request.kind == "counts"
    return possible_kinds(seen)[0] == "counts"


def _white(found: Finding, seen: Sample) -> NDArray[np.float64]:
    """The scanner's number for every view.

    Raises:
        InputError: projections are much brighter.
    """
    assert found.beam is not None
    level = float(found.beam.white or 0)
    if not 0 < level < float("inf") or seen.bright > _BRIGHTER * level:
        raise InputError(
            f"{found.path}: the beam is said to be {level:g} counts, and {found.name} has "
            f"{seen.bright:.4g} and more in one value of 20: name the flats (--flats), or give "
            "--flats air where the bins at both ends of the detector see nothing but air"
        )
    white = np.full(found.shape[0], level)
    white.flags.writeable = False
    return white


def _calibration(found: Finding, kind: Kind, substitute: str | None, flats: int, darks: int) -> str:
    if kind != "counts":
        return ""
    words = [f"{darks} dark{'s' * (darks != 1)}" if darks else "no darks"]
    if substitute == AIR:
        share = max(1, round(_AIR_SHARE * found.shape[2]))
        bins = "bin" if share == 1 else "bins"
        return f", an even beam from {share} {bins} of air at each end of every view, {words[0]}"
    if substitute == MEAN:
        return f", the beam taken to be the mean of every view, {words[0]}"
    if substitute == _WHITE:
        assert found.beam is not None
        return f", the beam {found.beam.white:g} counts as the scanner says, {words[0]}"
    words.insert(0, f"{flats} flat{'s' * (flats != 1)}")
    if found.flats_at is not None and len(np.unique(found.flats_at)) > 1:
        times = len(np.unique(found.flats_at))
        words[0] += f" at {times} times, interpolated between them,"
    return f", {' and '.join(words)}"


def _line(
    found: Finding, kind: Kind, seen: Sample, calibration: str, geometry: Geometry | None
) -> str:
    """What the file was taken to hold."""
    return f"{found.path.name}: {kind} ({seen}){calibration}; {_geometry(found, geometry)}."


def _geometry(found: Finding, geometry: Geometry | None) -> str:
    stored = dict(zip("nrb", found.shape, strict=True))
    sizes = " x ".join(str(stored[axis]) for axis in found.axes)
    parts = [f"axes {words(found.axes)} {sizes}", found.angle_words]
    if found.pitch is not None:
        parts.append(pitch_words(found.row_pitch, found.pitch, found.unit))
    if geometry is not None and found.beam is not None:
        parts.append(found.beam.words(geometry))
    return "; ".join(parts)
