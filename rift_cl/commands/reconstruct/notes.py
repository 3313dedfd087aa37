"""Assumptions and corrections of ``rift reconstruct``, a sentence each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.reconstruct.binned_file import row_binning
from rift_cl.reconstruct.preprocess import binning_note

if TYPE_CHECKING:
    from rift_cl.commands.reconstruct.slice_input import SliceInput

# A gap between directions that is worth a word, in mean steps and in radians.
_GAP_STEPS, _GAP = 2.0, np.deg2rad(5)


def notes_of(source: SliceInput) -> list[str]:
    """All that is to be said of a scan whose axis is known.

    Args:
        source: the scan; located.
    """
    notes = _axis(source)
    if source.fan is not None:
        angles = source.geometry.angles
        notes.append(
            f"Fan-beam views were resampled to {len(angles)} parallel ones, over "
            f"{np.rad2deg(np.ptp(angles)):.1f} degrees."
        )
    if source.settings.binning > 1:
        notes.append(_binning(source))
    if source.stitched is not None:
        notes.append(_stitched(source))
    elif source.settings.half_acquisition == "stitched":
        notes.append(
            "Nothing was stitched: this is no full turn with the axis off the middle of the "
            "detector."
        )
    if source.offset:
        notes.append(_offset(source))
    notes += _gap(source.geometry.angles)
    notes += source.clean.notes()
    if source.scan.background:
        notes.append(
            f"The mean of the outermost {source.scan.background} bins at each end (air) was "
            "subtracted."
        )
    if source.pad:
        notes.append(_wide(source))
    if source.settings.method == "levels":
        notes.append(
            "The object was taken to be a disc of one material with holes and a solid rim; the rim "
            "also gave the level of air and the beam hardening."
        )
    return notes


def _axis(source: SliceInput) -> list[str]:
    """Where the axis is, unless a person said it."""
    if source.settings.center is not None or source.centers is not None:
        return []
    if source.fan is not None:
        assert source.file.fan is not None
        center = source.file.fan.center
        middle = center == (source.file.shape[2] - 1) / 2
        where = "at the detector's middle" if middle else "where the file says"
        return [f"The axis was taken to be {where}, bin {center:.2f}; if it is not, give --center."]
    if source.estimate is None:
        return [f"The rotation axis was found before, at bin {source.center:.2f}."]
    return [f"The rotation axis was found {source.estimate.in_words()}."]


def _binning(source: SliceInput) -> str:
    n, (_, rows, bins) = source.settings.binning, source.file.shape
    block = row_binning(source.file, n)
    lost = binning_note(rows, bins, rows=block, bins=n)
    of = " of line integrals" if source.file.kind == "attenuation" else ""
    return (
        f"Blocks of {block} x {n} (rows x bins) detector pixels were averaged{of}. {lost}".rstrip()
    )


def _stitched(source: SliceInput) -> str:
    return (
        f"The axis, bin {source.axis['center']:.2f}, is off the middle of the detector in a full "
        "turn: opposite views were stitched into wider views over 180 degrees."
    )


def _offset(source: SliceInput) -> str:
    off = (
        f"The axis, bin {source.axis['center']:.2f}, is off the middle of the detector in a "
        "full turn"
    )
    # Iterative methods use every view as it is.
    joined = "" if source.settings.iterative else "opposite views were combined, and "
    return f"{off}: {joined}slices extend to the farther end."


def _wide(source: SliceInput) -> str:
    wide = "The object is wider than the detector (--pad)"
    if source.settings.iterative:
        return (
            f"{wide}: slices were computed with a margin of {source.pad} bins on each side, whose "
            "values are an extrapolation."
        )
    return (
        f"{wide}: projections were extrapolated smoothly beyond its ends; values outside the "
        "field of view are not measured."
    )


def _gap(angles: NDArray[np.float64]) -> list[str]:
    directions = np.sort(np.mod(angles, np.pi))
    gaps = np.diff(directions, append=directions[0] + np.pi)
    gap = float(gaps.max())
    if gap <= max(_GAP_STEPS * np.pi / len(angles), _GAP):
        return []
    return [
        f"{np.rad2deg(gap):.0f} of 180 degrees have no view (limited angle): edges in these "
        "directions are blurred."
    ]
