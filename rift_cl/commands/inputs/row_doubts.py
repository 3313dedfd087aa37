"""What a row of counts has against its own flats, darks and beam.

Line integrals are as good as the frames that they are divided by. Where these are not those of the
beam of the scan, slices come out all the same, with other values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.inputs.beam_level import beam_level
from rift_cl.commands.inputs.detector_rows import read_rows
from rift_cl.commands.inputs.stray_samples import stray_samples
from rift_cl.geometry import Cone
from rift_cl.io.scans.scan_file import ScanFile, ScanRows
from rift_cl.reconstruct.preprocess.flatfield import Attenuation

Floats = NDArray[np.float32]
# Share of the usual brightness below which a view has no beam.
_NO_BEAM = 0.05
# Share of the usual sum of line integrals below which a view shows no object, least mean of a view
# as a share of the largest line integrals, and most numbers of views that are listed.
_NO_OBJECT, _SHOWN, _LISTED = 0.2, 0.02, 6
# Share of samples without a signal that is worth a sentence.
_STARVED = 0.01
# Transmission that nothing explains, in the mean of neighbouring samples, and the share of them.
_BRIGHT, _NEIGHBOURS, _BRIGHT_SHARE = 1.15, (5, 5), 0.02
# Factor by which flats of one time may differ.
_UNLIKE = 1.5
# By how much of it flats of two levels differ at least, and how many times the differences within a
# level.
_TWO_LEVELS, _APART = 0.02, 4.0
# Share of a detector's flat pixels, or of samples, at the largest value that tells of saturation,
# and the least code of so many bits that detectors count to.
_FULL_SHARE, _LEAST_CODE = 0.02, 2**8 - 1
# Views over which both ends are averaged before they are compared, and by how much the difference
# of ends that are taken for air may change over the views, as a share of the largest line integral.
_BLUR, _CHANGE = 5, 0.05


def row_doubts(
    scan: ScanFile,
    row: int,
    found: Attenuation,
    *,
    remedy: str = "--zingers 6 takes most of them out",
) -> list[str]:
    """Sentences about a row, none where nothing is wrong with it.

    Args:
        scan: the scan.
        row: which.
        found: its line integrals, as they are worked on.
        remedy: of line integrals that no object has, in words.
    """
    lines = found.projections[:, 0]
    # Line integrals of others may be in any unit, and have no frames.
    if scan.kind == "attenuation":
        return _stray(scan, row, lines, remedy) + _weak_beam(scan, lines)
    rows = read_rows(scan, row, row + 1)
    if rows.lost.all():
        return []
    frames = rows.frames
    told = saturation(frames) or _frames(frames) or _no_air(scan, lines, frames.flats is not None)
    # Counts over the mean of each view say nothing of the level of the beam.
    if frames.flats is not None or scan.kind == "transmission" or scan.background:
        told = told or _bright(lines, row) or _weak_beam(scan, lines)
    two = _two_levels(scan, frames)
    silent = _silent(frames)
    starved = _starved(found, row, silent)
    return _dark_views(lines, silent) + _open_views(lines) + starved + two + told


def _stray(scan: ScanFile, row: int, lines: Floats, remedy: str) -> list[str]:
    """Samples far from all around them, which the other views know nothing of."""
    # Along a helix, and where vectors place them, no two views see the same plane.
    if scan.cone is not None and not (isinstance(scan.cone, Cone) and scan.cone.circular):
        return []
    stray = stray_samples(lines, scan.angles)
    count = np.count_nonzero(stray)
    if not count:
        return []
    sizes = lines[stray]
    most = float(sizes[np.argmax(np.abs(sizes))])
    return [
        f"Doubt: {count} samples of row {row} stand alone far from their neighbours, such as "
        f"{most:.4g}, and the other views show nothing of what they would measure: zingers, or "
        f"samples that were lost; {remedy}."
    ]


def _silent(rows: ScanRows) -> NDArray[np.bool_]:
    """(view,) whether no bin of a row is above the darks, as in frames of zeros."""
    level = np.float32(0) if rows.darks is None else rows.darks.mean(axis=0)
    silent: NDArray[np.bool_] = ~np.any(rows.projections > level, axis=(1, 2))
    return silent


def _dark_views(lines: Floats, silent: NDArray[np.bool_]) -> list[str]:
    """Views in which no bin sees what it usually does, or anything."""
    brightest = np.percentile(lines, 5, axis=1)
    # The line integrals of silent views are filled from their neighbours'.
    usual = np.median(brightest)
    dark = np.flatnonzero((brightest > usual - np.log(_NO_BEAM)) | silent)
    if not 0 < len(dark) < len(lines) / 2:
        return []
    where = f"view {dark[0]}" if len(dark) == 1 else f"views {_listed(dark)}"
    return [
        f"Doubt: {len(dark)} of {len(lines)} views have next to no beam ({where}): the shutter was "
        "shut, frames were lost, or they are darks; leave them out, with their angles."
    ]


def _open_views(lines: Floats) -> list[str]:
    """Views in which the object is missing: its line integrals sum up to as much in all of them."""
    sums = lines.mean(axis=1)
    usual = float(np.median(sums))
    if usual <= _SHOWN * float(np.percentile(lines, 99)):
        return []
    empty = np.flatnonzero(sums < _NO_OBJECT * usual)
    if not len(empty):
        return []
    where = f"view {empty[0]}" if len(empty) == 1 else f"views {_listed(empty)}"
    return [
        f"Doubt: {len(empty)} of {len(lines)} views show next to nothing of the object ({where}): "
        "they are flats; leave them out, with their angles."
    ]


def _listed(numbers: NDArray[np.intp]) -> str:
    """The first of some numbers, and that there are more."""
    shown = ", ".join(str(number) for number in numbers[:_LISTED])
    return shown if len(numbers) <= _LISTED else f"{shown}, ..."


def _starved(found: Attenuation, row: int, silent: NDArray[np.bool_]) -> list[str]:
    """Samples without a signal, but for those of views that are silent as a whole."""
    views, _, bins = found.projections.shape
    whole = int(silent.sum()) * (bins - found.dead)
    share = (found.starved - whole) / (views * bins)
    if share <= _STARVED:
        return []
    return [
        f"Doubt: {100 * share:.0f} % of the samples of row {row} have no signal above the darks' "
        "noise and were filled from their neighbours: the densities there are too low."
    ]


def saturation(rows: ScanRows) -> list[str]:
    """Pixels whose flats, and samples of views, that read the one largest value that there is.

    Counts of a beam scatter, so that few are the largest and more are one less. Where it is the
    other way round, the detector, or what cut its codes to fewer bits, goes no further: surely so
    where that is the largest code of some bits, and else where flats scatter from frame to frame.
    """
    most = float(rows.projections.max())
    told = []
    if rows.flats is not None:
        most = max(most, float(rows.flats.max()))
        told.append((rows.flats, "of the detector's pixels read {:.0f} in all flats"))
    told.append((rows.projections, "of the samples of a row read {:.0f}"))
    for frames, where in told:
        full = frames == most
        share = float((full if frames is rows.projections else full.all(axis=0)).mean())
        if share > _FULL_SHARE and (
            is_full_code(most) or (_scatters(rows) and _piled(frames, most))
        ):
            return [
                f"Doubt: {100 * share:.0f} % {where.format(most)}, the largest value of all: they "
                "are saturated, so that line integrals come out too small."
            ]
    return []


def _scatters(rows: ScanRows) -> bool:
    """Whether most pixels of flats that are not always at one value differ from frame to frame."""
    if rows.flats is None:
        return False
    spread = np.ptp(rows.flats, axis=0)
    below = spread[rows.flats.min(axis=0) < rows.flats.max()]
    return below.size > 0 and float(np.median(below)) > 0


def _piled(frames: Floats, most: float) -> bool:
    """Whether more samples read the largest value than the one before it."""
    below = frames[frames < most]
    return below.size > 0 and np.sum(frames == most) > np.sum(below == below.max())


def is_full_code(value: float) -> bool:
    """Whether a value is the largest code of some bits, which may be stored in the upper ones."""
    if value != int(value) or value < _LEAST_CODE:
        return False
    code = int(value)
    step = code & -code
    return (code + step).bit_count() == 1 and code // step >= _LEAST_CODE


def _frames(rows: ScanRows) -> list[str]:
    """What flats have against each other."""
    flats = rows.flats
    if flats is None or len(flats) < 2:
        return []
    dark = 0.0 if rows.darks is None else float(np.median(rows.darks))
    levels = np.median(flats, axis=(1, 2)) - dark
    if levels.min() > 0 and levels.max() <= _UNLIKE * levels.min():
        return []
    return [
        f"Doubt: the flats read {levels.min():.4g} to {levels.max():.4g} above the darks: some of "
        "them are not the open beam."
    ]


def _two_levels(scan: ScanFile, rows: ScanRows) -> list[str]:
    """Flats of two levels that no times tell apart, as where the beam changed in between."""
    flats = rows.flats
    if flats is None or (scan.flats_at is not None and len(np.unique(scan.flats_at)) > 1):
        return []
    dark = 0.0 if rows.darks is None else float(np.median(rows.darks))
    levels = np.sort(flats.mean(axis=(1, 2), dtype=np.float64) - dark)
    if len(levels) < 2 or levels[0] <= 0 or levels[-1] > _UNLIKE * levels[0]:
        return []
    gaps = np.diff(levels)
    widest = int(np.argmax(gaps))
    low, high = levels[: widest + 1], levels[widest + 1 :]
    within = max(float(np.ptp(low)), float(np.ptp(high)))
    if gaps[widest] <= max(_TWO_LEVELS * high.mean(), _APART * within):
        return []
    when = "nothing tells when they were taken"
    if scan.flats_at is not None:
        when = "all of them were taken at one time"
    return [
        f"Doubt: the flats read two levels, {low.mean():.4g} and {high.mean():.4g} above the "
        f"darks, and {when}: one mean of them was taken for all views, as if the beam had not "
        "changed."
    ]


def _bright(lines: Floats, row: int) -> list[str]:
    """Samples that are brighter than the open beam."""
    from scipy.ndimage import uniform_filter

    mean = uniform_filter(lines, _NEIGHBOURS, mode="nearest")
    share = float((mean < -np.log(_BRIGHT)).mean())
    if share <= _BRIGHT_SHARE:
        return []
    most = np.exp(min(-float(mean.min()), 50))
    return [
        f"Doubt: {100 * share:.0f} % of row {row} is brighter than the open beam, up to {most:.3g} "
        "times: the flats were taken with a weaker beam or with the object in it, or the values "
        "are inverted."
    ]


def _weak_beam(scan: ScanFile, lines: Floats) -> list[str]:
    """Ends of the detector that see air, which is off zero in some views or in all."""
    found = None if scan.background else beam_level(lines)
    if found is None:
        return []
    remedy = f"--background {found.bins} brings it to zero"
    level = float(found.levels.mean())
    if scan.kind == "attenuation":
        if found.constant:
            return [
                f"Both ends of the detector read {level:.3g} in all views alike, and air 0: if "
                f"they see nothing but air, {remedy}."
            ]
        return [
            f"Doubt: air {found.change.of_values}, as both ends of the detector show, which see "
            f"it: line integrals are off by as much in each view; {remedy} in every view."
        ]
    if found.constant:
        weaker = "weaker" if level > 0 else "stronger"
        return [
            f"Doubt: both ends of the detector read {level:.3g} in all views alike, as where the "
            f"beam was {weaker} than in the flats: if they see nothing but air, {remedy}."
        ]
    return [
        f"Doubt: the beam {found.change.of_beam}, as both ends of the detector show, which see "
        f"air: line integrals are off by as much in each view; {remedy} in every view."
    ]


def _no_air(scan: ScanFile, lines: Floats, flats: bool) -> list[str]:
    """Ends that the beam is taken from, and that change against each other from view to view.

    The beam of a view is one for both ends, however it changes; what turns is not.
    """
    from scipy.ndimage import uniform_filter1d

    count = scan.background
    if not count or len(lines) < _BLUR:
        return []
    apart = lines[:, :count].mean(axis=1) - lines[:, -count:].mean(axis=1)
    change = float(uniform_filter1d(apart, _BLUR, mode="nearest").std())
    most = float(np.ptp(lines))
    if change <= _CHANGE * most:
        return []
    remedy = "leave out --background" if flats else "give flats, or --flats mean"
    return [
        f"Doubt: the outermost {count} bins at the two ends of the detector, which the beam is "
        f"taken from as air, change against each other by {100 * change / most:.0f} % of the "
        f"largest line integral from view to view: the object reaches into them; {remedy}."
    ]
