"""From a scan in a file to projections that a method can take: what is mended, and what assumed.

Clean line integrals (``clean_rows``) go through these steps, each of which is said in ``notes``:
offset axis, continuation beyond the detector. Fans stay fans, but where a method or a span wants
parallel views.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.axis_alignment import Alignment
from rift_cl.commands.inputs.beam_level import beam_level
from rift_cl.commands.inputs.row_doubts import row_doubts
from rift_cl.commands.inputs.scan_axis import (
    SettledAxis,
    doubted_circle,
    find_axis,
    settled_axis,
    tilt_worth_turning,
)
from rift_cl.commands.inputs.scan_identity import WatchedScan
from rift_cl.commands.inputs.scan_lengths import BIN
from rift_cl.commands.inputs.scan_rows import check_center, chosen_rows
from rift_cl.commands.inputs.told_axis import (
    doubted_parallel,
    found_in_words,
    hole_in_words,
    offset_in_words,
)
from rift_cl.commands.inputs.told_lacks import missing_directions
from rift_cl.commands.reconstruct.binned_file import binned_file, row_binning
from rift_cl.commands.reconstruct.clean_rows import CleanRows, LoadedRows
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.errors import InputError
from rift_cl.geometry import Fan, Parallel, at_axis
from rift_cl.geometry.length_units import length_unit
from rift_cl.io.number_list import read_numbers
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct import Attenuation
from rift_cl.reconstruct.axis import AxisEstimate
from rift_cl.reconstruct.direct.fan_rebin import covered_rays, rebin_fan
from rift_cl.reconstruct.direct.offset_axis import (
    is_bridged,
    is_full_turn,
    is_offset,
    passes_half,
    seen_bins,
    sees_further,
    shows_both_sides,
    widened,
)
from rift_cl.reconstruct.direct.padding import extended, is_truncated, wider
from rift_cl.reconstruct.direct.redundancy import ITERATE, redundancy
from rift_cl.reconstruct.preprocess import binned_center, binning_note, stitched
from rift_cl.reconstruct.solvers.variation_weight import noise_of_rays

Floats = NDArray[np.float32]
# The detector is continued by this share of its width on each side.
_PAD_SHARE = 2
# Noise below this share of the greatest line integral spoils nothing.
_LITTLE = 1e-3
# Bins that a sentence lists at most.
_MOST_LISTED = 8


class SliceInput:
    """The projections of some rows, of parallel rays or of a fan's, about a known axis.

    Args:
        settings: where the scan is and what is to be done with it.
        device: where the rotation axis is looked for.
        file: the scan, where it was opened before.

    Raises:
        RiftError: the scan cannot be read, or an option does not fit it.
    """

    def __init__(
        self, settings: ReconstructSettings, device: Device, file: ScanFile | None = None
    ) -> None:
        self.settings, self.device = settings, device
        # The scan as the file has it, and as it is worked on.
        self.file = settings.open_scan(fan=True) if file is None else file
        self.watched = WatchedScan(self.file)
        check_center(settings.center, self.file)
        binning = settings.binning
        self.scan = binned_file(self.file, binning)
        self.rows = self._binned_rows()
        pitch = (self.file.pitch or 1.0) if settings.pitch is None else settings.pitch
        if self.file.fan is not None and settings.tilt:
            raise InputError(f"{self.file.path}: --tilt is for parallel rays, these are a fan's")
        self.unit = self.file.unit or (BIN if pitch == 1.0 else "")
        self._pitch = pitch * binning
        # Bin of the rotation axis on the detector as the file has it, at its middle row.
        self.center = settings.center
        # That of each row, where each has its own.
        self.centers = self._row_centers()
        if self.centers is not None:
            self.center = float(self.centers.mean())
        # Degrees by which the axis leans, and by which projections are turned.
        self.tilt = settings.tilt or 0.0
        # What the search for the axis found, where there was one.
        self.estimate: AxisEstimate | None = None
        # What became of a fan's, and whether its angles run the other way than the file's.
        self.settled_by: SettledAxis | None = None
        self.turned = False
        # The axis as the configuration records it: the bin, and how it was found.
        self.axis: dict[str, Any] = {}
        self.pad = 0
        # (angle, bin) whether a ray was measured, where some were not.
        self.seen: NDArray[np.bool_] | None = None
        self.notes: list[str] = [*self.file.notes]
        # The geometry of a full turn whose opposite views are stitched; None where none are.
        self.stitched: Parallel | None = None
        # Made now, so that a bad pitch or center is told before any work.
        self.fan = self._fan()
        self.geometry = self._geometry()
        # Whether a turn's axis is so far off the middle that slices reach beyond the detector.
        self.offset = self._sees_farther()
        # Whether the object reaches beyond the farther end, too.
        self.beyond = False
        length = length_unit(self.unit)
        pixel = None
        if length is not None:
            across = self._pitch * length.metres
            pixel = (across * self.scan.aspect, across)
        self.clean = CleanRows(self.scan, settings, pixel, device)

    @property
    def pitch(self) -> float:
        """Distance between rays at the rotation axis."""
        return at_axis(self.geometry).pitch

    @property
    def row_pitch(self) -> float:
        """Distance between slices: that between rows at the rotation axis."""
        return self.pitch * self.scan.aspect

    @property
    def height(self) -> float:
        """Height of the first slice above the file's row 0: that of the middle of its block."""
        block = row_binning(self.file, self.settings.binning)
        return (self.rows[0] + (block - 1) / (2 * block)) * self.row_pitch

    @property
    def detector_pitch(self) -> float:
        """Distance between bins of the detector as the file has it."""
        pitch = self._pitch if self.fan is None else self.fan.pitch
        return pitch / self.settings.binning

    @property
    def bins(self) -> int:
        """Bins between the farther end of the detector and its mirror image, or the detector's."""
        return seen_bins(self.geometry) if self.offset else self.geometry.bins

    @property
    def settled(self) -> bool:
        """Whether the axis is known."""
        return self.center is not None

    @property
    def rebinned(self) -> bool:
        """Whether a fan's views are resampled to parallel ones."""
        return self.fan is not None and isinstance(self.geometry, Parallel)

    @property
    def most_bins(self) -> int:
        """The most that ``bins`` may come to once the axis is known."""
        may_grow = not self.settled and self._goes_round(self.scan.angles)
        return 2 * self.bins if may_grow else self.bins

    def locate(self, *, doubt: bool = True) -> None:
        """Find the axis, and whether it is offset and the object wider than the detector.

        The axis is that of the whole scan; the object's width is judged by the middle row.

        Args:
            doubt: whether to look for what the data have against an axis that is known, which takes
                as long as finding it.

        Raises:
            InputError: the axis cannot be found, or views are to be stitched that cannot be.
        """
        middle = sum(self.rows) // 2
        read = self.clean.read(middle, middle + 1)
        row = read.projections
        doubts = row_doubts(self.scan, middle, read)
        if not self.settled:
            try:
                self._find_axis()
            except InputError as error:
                if not doubts:
                    raise
                raise type(error)(" ".join([f"{error}.", *doubts])) from error
        elif doubt:
            self.notes += self._doubts(row[:, 0])
        self.fan = self._fan()
        self.geometry = self._geometry()
        self.axis = self._axis_record()
        self.clean.alignment = self._alignment()
        self.offset = self._sees_farther()
        if self.settings.half_acquisition == "stitched" and self.off_middle:
            assert isinstance(self.geometry, Parallel)
            self._check_full_turn()
            self.stitched, self.offset = self.geometry, False
            row, self.geometry = stitched(row, self.stitched, device=self.device)
        # What one side of the detector misses is no truncation where the other side has it.
        measured = row if self.settings.iterative else self._both_sides(row)[0]
        wanted = self.settings.pad == "auto" and is_truncated(measured) and not self.offset
        # Air that is off zero is no object that goes on.
        wanted = wanted and beam_level(read.projections[:, 0]) is None
        self.beyond = self.offset and is_truncated(row, self.geometry.center)
        if wanted or self.settings.pad == "on":
            self.pad = max(1, self.scan.shape[2] // _PAD_SHARE)
            self.geometry = self.geometry if self.fan is None else self._geometry()
        self.notes += _notes_of(self) + doubts + self._noise_note(row[:, 0])
        if self.settings.binning == 1:
            self.notes += _filled_notes(read, middle)

    def _doubts(self, row: Floats) -> list[str]:
        """What the data have against the angles, and against an axis that was given."""
        given = self.settings.center
        if self.fan is not None:
            if given is None:
                return []
            return doubted_circle(self.file, given, self.device, zingers=self.settings.zingers)
        block = row_binning(self.file, self.settings.binning)
        middle = binned_center((self.file.shape[1] - 1) / 2, block)
        return doubted_parallel(
            self.file,
            row,
            given,
            self.tilt,
            away=block * (sum(self.rows) // 2 - middle),
            spanned=self.spanned,
            device=self.device,
            zingers=self.settings.zingers,
        )

    @property
    def spanned(self) -> int:
        """How many of the file's rows lie between the outermost slices, these included."""
        return (self.rows[1] - self.rows[0]) * row_binning(self.file, self.settings.binning)

    def _noise_note(self, row: Floats) -> list[str]:
        """What least squares that stop at no noise make of noisy data, and where they would."""
        settings = self.settings
        if settings.method not in ("cgls", "sirt") or settings.noise or settings.weights:
            return []
        order = np.argsort(np.mod(self.scan.angles, 2 * np.pi), kind="stable")
        views = row[order] if self.stitched is None else row
        noise = noise_of_rays(views, np.ones_like(views))
        if noise < _LITTLE * float(np.abs(views).max()):
            return []
        return [
            f"--method {settings.method} takes all of its {settings.most_steps} steps, the later "
            "of which fit the noise as well, or ends before it has converged: the data show noise "
            f"of about {noise:.2g} in a line integral, and --noise {noise:.2g} stops there."
        ]

    def _find_axis(self) -> None:
        """Find the axis, of a fan the sense of rotation too."""
        geometry, zingers = self.file.geometry, self.settings.zingers
        if isinstance(geometry, Fan):
            center = geometry.center
            self.settled_by = settled_axis(self.file, center, self.device, zingers=zingers)
            self.center, self.turned = self.settled_by.center, self.settled_by.turned
            return
        rows = self.settings.rows
        self.estimate = find_axis(self.file, self.device, zingers=zingers, rows=rows)
        self.center = self.estimate.center
        if self.settings.tilt is None:
            self.tilt = tilt_worth_turning(self.estimate, self.file.shape[1])

    def identity(self) -> dict[str, Any]:
        """The file and the axis, which decide the slices besides the settings."""
        axis: dict[str, Any] = {"axis": repr(self.center), "tilt of the axis": repr(self.tilt)}
        if self.centers is not None:
            axis["axes of the rows"] = str(self.centers.tolist())
        if self.fan is not None:
            axis["angles"] = "reversed" if self.turned else "as given"
        return {**self.watched.identity(), **axis}

    def read(self, start: int, stop: int) -> Attenuation:
        """Projections of some rows of the file, before a formula's weights and margins."""
        return self.projections(self.clean.load(start, stop))

    def projections(self, loaded: LoadedRows) -> Attenuation:
        """The same of rows that were loaded before."""
        integrals = self.clean.clean(loaded)
        if self.stitched is not None:
            wide, _ = stitched(integrals.projections, self.stitched, device=self.device)
            return dataclasses.replace(integrals, projections=wide)
        if self.fan is None or not self.rebinned:
            return integrals
        parallel, _ = rebin_fan(
            integrals.projections,
            self.fan.angles,
            self.fan.beam,
            whole=not self.settings.iterative,
        )
        return dataclasses.replace(integrals, projections=parallel)

    def for_formula(self, projections: Floats) -> tuple[Floats, Parallel | Fan]:
        """Projections as a backprojection wants them, and their geometry."""
        projections, scan = self._both_sides(projections)
        if self.pad:
            projections, scan = extended(projections, scan, bins=self.pad)
        return np.ascontiguousarray(projections), scan

    def _both_sides(self, projections: Floats) -> tuple[Floats, Parallel | Fan]:
        """Parallel projections of a full turn with what either side of the detector sees."""
        scan = self.geometry
        if isinstance(scan, Parallel) and not self.rebinned and shows_both_sides(scan):
            return widened(projections, scan)
        return projections, scan

    def formula_geometry(self) -> Parallel | Fan:
        """What ``for_formula`` would say of the geometry."""
        return self.for_formula(np.zeros((1, 1, self.geometry.bins), np.float32))[1]

    def _fan(self) -> Fan | None:
        """The fan with the axis, the sense and the pitch that are said or found."""
        fan, settings = self.scan.geometry, self.settings
        if not isinstance(fan, Fan):
            return None
        if settings.pitch is not None:
            fan = dataclasses.replace(fan, pitch=self._pitch)
        if self.center is not None:
            fan = dataclasses.replace(fan, center=binned_center(self.center, settings.binning))
        return fan.at(-fan.angles) if self.turned else fan

    def _geometry(self) -> Parallel | Fan:
        fan, settings = self.fan, self.settings
        if fan is None:
            center = None if self.center is None else binned_center(self.center, settings.binning)
            return Parallel(self.scan.angles, self.scan.shape[2], self._pitch, center)
        if not self._wants_parallel(fan):
            return fan
        whole = not settings.iterative
        scan, rays = covered_rays(fan.angles, fan.bins, fan.beam, whole=whole)
        self.seen = None if rays.all() else rays
        return scan

    def _wants_parallel(self, fan: Fan) -> bool:
        """Whether the method takes parallel views alone, or the span is too short for a fan's."""
        settings = self.settings
        if settings.method == "levels" or settings.error is not None:
            return True
        if settings.method != "fbp":
            return False
        try:
            redundancy(wider(fan, self.pad, self.pad), settings.compensate)
        except InputError:
            return True
        return False

    def _binned_rows(self) -> tuple[int, int]:
        """The rows that are asked for, of the scan as it is worked on."""
        block = row_binning(self.file, self.settings.binning)
        first, stop = (row // block for row in chosen_rows(self.settings.rows, self.file))
        if first == stop:
            raise InputError(
                f"--rows has fewer rows than --binning {self.settings.binning} makes one of"
            )
        return first, stop

    def _row_centers(self) -> NDArray[np.float64] | None:
        """Bins of the axis in the rows of the file, where a list of them is given."""
        path = self.settings.centers
        if path is None:
            return None
        if self.file.fan is not None:
            raise InputError(f"{self.file.path}: --centers is for parallel rays, not a fan's")
        centers = read_numbers(path, "rotation axes")
        rows, bins = self.file.shape[1:]
        if centers.size != rows or not (np.abs(centers - (bins - 1) / 2) < bins).all():
            raise InputError(
                f"{path}: holds {centers.size} rotation axes, wanted one for each of the {rows} "
                f"rows of {self.file.path}, bins from 0 to {bins - 1}"
            )
        return centers

    def _alignment(self) -> Alignment | None:
        """How projections are turned, where the axis leans."""
        tilt = math.radians(self.tilt)
        if self.fan is not None or (not tilt and self.centers is None):
            return None
        block = row_binning(self.file, self.settings.binning)
        if self.centers is not None:
            rows = self.centers[: self.scan.shape[1] * block].reshape(-1, block).mean(axis=1)
            centers = np.array([binned_center(row, self.settings.binning) for row in rows])
            return Alignment(self.geometry.center, 0.0, centers=centers)
        pivot = binned_center((self.file.shape[1] - 1) / 2, block)
        return Alignment(self.geometry.center, pivot, tilt, aspect=self.scan.aspect)

    @property
    def off_middle(self) -> bool:
        """Whether parallel rays were measured further on one side of the axis than on the other."""
        scan = self.geometry
        if not isinstance(scan, Parallel) or self.rebinned:
            return False
        return sees_further(scan.center, scan.bins)

    def _sees_farther(self) -> bool:
        if isinstance(self.geometry, Fan):
            return is_offset(self.geometry)
        return self.off_middle and self._goes_round(self.geometry.angles)

    def _goes_round(self, angles: NDArray[np.float64]) -> bool:
        """Whether the method makes slices to the farther end of parallel views at these angles."""
        return passes_half(angles) if self.settings.iterative else is_bridged(angles)

    def _check_full_turn(self) -> None:
        """Refuse to stitch views that are no full turn.

        Raises:
            InputError: they are none.
        """
        if is_full_turn(self.geometry.angles):
            return
        raise InputError(
            f"{self.file.path}: --half-acquisition stitched joins the opposite views of a full "
            f"turn, and there is no view {hole_in_words(self.geometry.angles)}; --half-acquisition "
            f"weighted bridges up to 15 degrees, and {ITERATE} (--method)"
        )

    def _axis_record(self) -> dict[str, Any]:
        if self.settings.center is not None:
            return {"center": self.settings.center, "by": "--center"}
        if self.centers is not None:
            return {"center": self.center, "by": "--centers", "rows": list(self.centers)}
        if self.settled_by is not None:
            return self.settled_by.record
        if self.estimate is None:
            return {"center": self.center, "by": "search"}
        return self.estimate.record()


def _notes_of(source: SliceInput) -> list[str]:
    """All that is to be said of a scan whose axis is known.

    Args:
        source: the scan; located.
    """
    notes = _pitch_note(source) + _axis_note(source)
    if source.fan is not None:
        notes += _fan_note(source)
    if source.settings.binning > 1:
        notes.append(_binning_note(source))
        notes += _rows_note(source)
    if source.stitched is not None:
        notes.append(_stitched_note(source))
    elif source.settings.half_acquisition == "stitched":
        notes.append(
            "Nothing was stitched: this is no full turn with the axis off the middle of the "
            "detector."
        )
    if source.offset:
        notes.append(_offset_note(source))
    elif source.off_middle and passes_half(source.geometry.angles):
        notes.append(_one_sided_note(source))
    notes += missing_directions(source.geometry.angles)
    notes += source.clean.notes()
    if source.scan.background:
        notes.append(
            f"The mean of the outermost {source.scan.background} bins at each end (air) was "
            "subtracted."
        )
    if source.pad:
        notes.append(_wide_note(source))
    if source.settings.method == "levels":
        notes.append(
            "The object was taken to be a disc of one material with holes and a solid rim; the rim "
            "also gave the level of air and the beam hardening."
        )
    return notes


def _axis_note(source: SliceInput) -> list[str]:
    """Where the axis is, unless a person said it."""
    if source.settings.center is not None or source.centers is not None:
        return []
    if source.settled_by is not None:
        return list(source.settled_by.notes)
    if source.estimate is None:
        return [f"The rotation axis was found before, at bin {source.center:.2f}."]
    rows, tilt = source.file.shape[1], source.settings.tilt
    return found_in_words(source.estimate, rows, source.spanned, tilt)


def _pitch_note(source: SliceInput) -> list[str]:
    """What the unit of lengths is, where nobody says it."""
    given, own, unit = source.settings.pitch, source.file.pitch, source.unit
    if given is None and own is None:
        return ["No distance between detector bins is known (--pitch): lengths are in bins."]
    if given is None or own is None or math.isclose(given, own, rel_tol=1e-6):
        return []
    alike = source.file.aspect != 1 and source.settings.row_pitch is None
    return [
        f"--pitch {given:g} {unit} takes the place of {own:.4g} {unit}, which the file says"
        f"{'; the distance between rows changes alike' if alike else ''}."
    ]


def _fan_note(source: SliceInput) -> list[str]:
    """How filtered backprojection, or what else takes parallel views, takes a fan's."""
    angles = source.geometry.angles
    if source.rebinned:
        return [
            f"Fan-beam views were resampled to {len(angles)} parallel ones, over "
            f"{np.rad2deg(np.ptp(angles)):.1f} degrees."
        ]
    if source.settings.method != "fbp":
        return []
    assert source.fan is not None
    counted = redundancy(source.fan, source.settings.compensate)
    return [f"Filtered backprojection of a fan: {counted.sentence}."]


def _binning_note(source: SliceInput) -> str:
    n, (_, rows, bins) = source.settings.binning, source.file.shape
    block = row_binning(source.file, n)
    lost = binning_note(rows, bins, rows=block, bins=n)
    of = " of line integrals" if source.file.kind == "attenuation" else ""
    return (
        f"Blocks of {block} x {n} (rows x bins) detector pixels were averaged{of}. {lost}".rstrip()
    )


def _rows_note(source: SliceInput) -> list[str]:
    """Which rows were taken, where blocks do not begin or end at those that were asked for."""
    asked, block = source.settings.rows, row_binning(source.file, source.settings.binning)
    first, stop = (block * row for row in source.rows)
    if asked is None or tuple(asked) == (first, stop):
        return []
    return [
        f"Of --rows {asked[0]} {asked[1]}, the rows {first} to {stop - 1} were taken, as blocks of "
        f"{block} rows are counted from the detector's first row."
    ]


def _stitched_note(source: SliceInput) -> str:
    return (
        f"The axis, bin {source.axis['center']:.2f}, is off the middle of the detector in a full "
        "turn: opposite views were stitched into wider views over 180 degrees."
    )


def _offset_note(source: SliceInput) -> str:
    # Iterative methods use every view as it is.
    beyond = (
        " The object reaches beyond that end as well: values near the border of the field of view "
        "are too large."
    )
    words = offset_in_words(
        source.axis["center"], source.geometry.angles, combined=not source.settings.iterative
    )
    return f"{words}{beyond if source.beyond else ''}"


def _one_sided_note(source: SliceInput) -> str:
    """What is said of an axis off the middle where opposite views cannot be combined."""
    scan = source.geometry
    return (
        f"The axis, bin {source.axis['center']:.2f}, is off the middle of the detector, and the "
        f"views do not go all round (none {hole_in_words(scan.angles)}): objects that reach "
        f"further from the axis than {min(scan.center, scan.bins - 1 - scan.center):.4g} bins are "
        f"not right; {ITERATE} (--method)."
    )


def _wide_note(source: SliceInput) -> str:
    wide = "The object is wider than the detector (--pad)"
    inside = (
        "Inside it, what lies beyond leaves the level of values uncertain by a smooth error, often "
        "of 10 % and more (the interior problem)."
    )
    if source.settings.iterative:
        return (
            f"{wide}: slices were computed with a margin of {source.pad} bins on each side, whose "
            f"values are an extrapolation, as are all outside the field of view. {inside}"
        )
    return (
        f"{wide}: projections were extrapolated smoothly beyond its ends; values outside the "
        f"field of view are not measured. {inside}"
    )


def _filled_notes(read: Attenuation, row: int) -> list[str]:
    """Which pixels of a row were filled from their neighbours, and why."""
    stuck = read.stuck_bins
    dead = tuple(bin for bin in read.dead_bins if bin not in stuck)
    told = [
        (dead, "does not answer to the beam", "do not answer to the beam", "dead or masked"),
        (stuck, "reads the same in all views", "read the same in all views", "stuck or saturated"),
    ]
    return [
        f"In row {row} {_listed(bins)} {one if len(bins) == 1 else many} ({why} pixels) and "
        f"{'was' if len(bins) == 1 else 'were'} filled from the neighbours."
        for bins, one, many, why in told
        if bins
    ]


def _listed(bins: tuple[int, ...]) -> str:
    listed = ", ".join(map(str, bins[:_MOST_LISTED])) + (", ..." if bins[_MOST_LISTED:] else "")
    return f"bin {listed}" if len(bins) == 1 else f"bins {listed}"
