"""Lengths of a scan as a person wants them: ``--pitch``, ``--row-pitch``, ``--unit``, a file's own.

A density per unit of length is wrong by a power of ten where a unit is. So a unit that is asked for
converts what the file says in another one, names what the file says in none, and is refused where
there is no length that it could be the unit of.
"""

from __future__ import annotations

import dataclasses
import math

from rift_cl.errors import InputError
from rift_cl.geometry.length_units import known_units, length_unit
from rift_cl.io.scans.scan_file import ScanFile, pitch_words

# The unit of lengths that are counted in bins.
BIN = "bin"


def with_lengths(
    scan: ScanFile, pitch: float | None, unit: str | None, row_pitch: float | None = None
) -> ScanFile:
    """The scan with its lengths in the unit that is asked for.

    Args:
        scan: as its file has it.
        pitch: distance between bins that takes the place of the file's, in ``unit``; or None.
        unit: of the lengths; the file's own if None.
        row_pitch: distance between rows that takes the place of the file's, in ``unit``; or None.

    Returns:
        The scan; its pitch is still that of the file, where that has one, and that between rows is
        to the file's as the one that was given is to ``pitch``.

    Raises:
        InputError: the unit is none of length, it has no length to belong to or none in a unit
            that is known, the pitch has no unit beside a file that has one, or the one between
            rows is no length or is a cone's.
    """
    scan = _in_unit(scan, pitch, unit)
    return scan if row_pitch is None else with_row_pitch(scan, row_pitch, pitch)


def with_row_pitch(scan: ScanFile, row_pitch: float, pitch: float | None = None) -> ScanFile:
    """The scan with another distance between rows, which says what shape its pixels have.

    Args:
        scan: with its lengths in the unit of the others.
        row_pitch: distance between rows.
        pitch: that between bins where it takes the place of the scan's; or None.

    Raises:
        InputError: it is no length, or the scan is a cone's.
    """
    if not 0 < row_pitch < math.inf:
        raise InputError(f"--row-pitch is {row_pitch:g}, wanted a length above 0")
    if scan.cone is not None:
        raise InputError(
            f"--row-pitch is for parallel beams and fans, {scan.path} is a cone-beam scan: how "
            "high its rows are is in its geometry (--geometry)"
        )
    notes = scan.notes
    if scan.row_pitch is not None and not math.isclose(scan.row_pitch, row_pitch, rel_tol=1e-6):
        length = f"{scan.row_pitch:.4g} {scan.unit}".rstrip()
        note = f"--row-pitch {row_pitch:g} takes the place of {length}, which the file says."
        notes = (*notes, note)
    if pitch is None and scan.pitch is None:
        note = (
            "No distance between detector bins is known (--pitch): lengths, that of --row-pitch "
            "too, are in bins."
        )
        notes = (*notes, note)
    bins = scan.pitch or pitch or 1.0
    rows = row_pitch * bins / (pitch or bins)
    return dataclasses.replace(scan, pitch=bins, row_pitch=rows, notes=notes)


def _in_unit(scan: ScanFile, pitch: float | None, unit: str | None) -> ScanFile:
    """The scan with its lengths in a unit, its pitches still those of the file."""
    if unit is None:
        if pitch is not None and scan.unit:
            raise InputError(
                f"--pitch {pitch:g} has no unit, and lengths in {scan.path} are in {scan.unit}: "
                f"say which it is with --unit, such as --unit {scan.unit}"
            )
        # A pitch of 1 counts in bins, which is a unit with a name.
        if pitch in (None, 1.0) or scan.unit:
            return scan
        note = (
            "Lengths, and values per length, are in a unit without a name: --unit says which that "
            f"of --pitch {pitch:g} is."
        )
        return dataclasses.replace(scan, notes=(*scan.notes, note))
    own, wanted = length_unit(scan.unit), length_unit(unit)
    if wanted is None and unit not in ("", BIN, scan.unit):
        raise InputError(f"--unit is {unit!r}, wanted a unit of length: {known_units()}")
    if wanted is not None and pitch is None and scan.pitch is None:
        raise InputError(
            f"--unit {unit} needs --pitch, the distance between detector bins in {unit}: "
            f"{scan.path} gives none"
        )
    if scan.unit in (unit, ""):
        return dataclasses.replace(scan, unit=unit)
    if wanted is None:
        note = f"Lengths in {scan.unit}, the file's unit, were taken to be in {unit} (--unit)."
        return dataclasses.replace(scan, unit=unit, notes=(*scan.notes, note))
    if own is None:
        return _in_place_of_unknown(scan, pitch, unit)
    # Of powers of ten, exactly: 1e-3 / 1e-6 is not 1000.
    return _converted(scan, unit, float(f"{own.metres / wanted.metres:.12g}"))


def _in_place_of_unknown(scan: ScanFile, pitch: float | None, unit: str) -> ScanFile:
    """The scan in a unit where its own is not known, so that nothing can be converted.

    Raises:
        InputError: no other length takes the place of the file's.
    """
    parallel = scan.fan is None and scan.cone is None
    if pitch is None or not parallel:
        remedy = (
            f"--pitch, the distance between detector bins in {unit}"
            if parallel
            else "--geometry, a file with all lengths in one of them"
        )
        raise InputError(
            f"{scan.path}: its lengths are in {scan.unit!r}, which is none of {known_units()}, so "
            f"that --unit {unit} cannot convert them: give {remedy}"
        )
    note = f"The file's lengths are in {scan.unit!r}, a unit that is not known: --pitch is used."
    return dataclasses.replace(scan, unit=unit, notes=(*scan.notes, note))


def _converted(scan: ScanFile, unit: str, factor: float) -> ScanFile:
    """The scan with every length times a factor, in another unit."""
    lengths = ("source_to_axis", "source_to_detector", "pitch")
    fan = scan.fan
    if fan is not None:
        fan = dataclasses.replace(fan, **{name: factor * getattr(fan, name) for name in lengths})
    pitch = None if scan.pitch is None else factor * scan.pitch
    row_pitch = None if scan.row_pitch is None else factor * scan.row_pitch
    told = "" if pitch is None else f": {pitch_words(row_pitch, pitch, unit)}"
    # Two names of one unit change nothing that is worth a word.
    note = f"The file's lengths, in {scan.unit}, were converted to {unit} (--unit){told}."
    return dataclasses.replace(
        scan,
        pitch=pitch,
        row_pitch=row_pitch,
        unit=unit,
        fan=fan,
        cone=None if scan.cone is None else scan.cone.scaled(factor),
        notes=scan.notes if math.isclose(factor, 1) else (*scan.notes, note),
    )
