"""The projections of a cone-beam scan, all rows of them, and where the volume lies."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.device import Device
from rift_cl.commands.inputs.axis_alignment import Alignment
from rift_cl.commands.inputs.beam_level import BeamLevel, beam_level
from rift_cl.commands.inputs.row_doubts import row_doubts
from rift_cl.commands.inputs.scan_identity import WatchedScan
from rift_cl.commands.inputs.scan_rows import check_center
from rift_cl.commands.inputs.told_axis import axis_of_cone, unchecked_helix
from rift_cl.commands.reconstruct.binned_file import binned_file, row_binning
from rift_cl.commands.reconstruct.clean_rows import CleanRows
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_window import check_window
from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.geometry import Cone, Grid, Vectors
from rift_cl.geometry.seen_grid import scan_lengths, seen_grid, slices_beyond
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct import Attenuation
from rift_cl.reconstruct.direct.padding import goes_on
from rift_cl.reconstruct.direct.upright_views import FINER
from rift_cl.reconstruct.preprocess import binned_center, binning_note

# Options that do not apply to cones, with what they are where they are not used.
_REFUSED: dict[str, Any] = {
    "error": None,
    "centers": None,
    "half_acquisition": "weighted",
}
# Volumes and stacks of projections that a method holds at a time, on host and device together.
_HELD = {"fbp": (3, 5), "backproject": (3, 4), "sirt": (6, 6), "cgls": (6, 6), "tv": (9, 6)}
# Stacks of projections on the host where a volume is worked on in parts: as read, corrected, and
# filtered or with weights of rays.
_HELD_BESIDE_PARTS = {"fbp": 3, "backproject": 2, "sirt": 5, "cgls": 5, "tv": 5}


@dataclass(frozen=True)
class VolumeWindow:
    """Where the volume lies.

    Args:
        whole: all that the detector sees, or what was asked for, about the axis.
        roi: first column, the one after the last, first line, the one after the last.
        slices: first slice, and the one after the last.
    """

    whole: Grid
    roi: tuple[int, int, int, int]
    slices: tuple[int, int]

    @classmethod
    def of(
        cls, settings: ReconstructSettings, scan: Cone | Vectors, *, settled: bool = True
    ) -> VolumeWindow:
        """What the settings ask for.

        Args:
            settings: the part that is wanted.
            scan: the geometry.
            settled: whether its axis is final; a part is refused before only if it will be outside
                wherever on the detector the axis is.

        Raises:
            InputError: a part is not inside the volume, or the volume holds the source.
        """
        whole = seen_grid(scan, settings.pixel)
        if settings.size is not None:
            across = (settings.size, settings.size)
            whole = Grid((whole.shape[0], *across), whole.spacing, whole.center)
        size, count = whole.shape[-1], whole.shape[0]
        roi = settings.roi or (0, size, 0, size)
        # The volume is widest about an axis at the detector's edge.
        known = settled or settings.size is not None
        widest = 2 * scan.bins * scan_lengths(scan).pixel[1] / whole.spacing[-1]
        check_window(roi, size if known else max(size, math.ceil(widest - 1e-6)))
        slices = settings.rows or (0, count)
        if not 0 <= slices[0] < slices[1] <= count:
            raise InputError(
                f"--rows is {slices[0]} {slices[1]}, the volume has the slices 0 to {count}: give "
                "the first and the one after the last"
            )
        window = cls(whole, roi, slices)
        corner, source = window.reach, scan_lengths(scan).source_to_axis
        # About another axis the columns of a part lie elsewhere, while a whole volume only grows.
        if corner >= source and (known or settings.roi is None):
            raise InputError(
                f"the volume reaches {corner:g} from the axis, and the source is {source:g} away: "
                "it would be inside; reconstruct less (--size, --roi), or mend the distances "
                "(--geometry)"
            )
        return window

    @property
    def reach(self) -> float:
        """Distance of the farthest corner of the part from the axis."""
        grid = self.grid
        edges = [
            abs(grid.center[axis]) + grid.shape[axis] * grid.spacing[axis] / 2 for axis in (1, 2)
        ]
        return math.hypot(*edges)

    @property
    def pixel(self) -> float:
        """Edge of a voxel."""
        return self.whole.spacing[-1]

    @property
    def grid(self) -> Grid:
        """The part that is wanted."""
        left, right, top, bottom = self.roi
        starts = (self.slices[0], top, left)
        counts = (self.slices[1] - self.slices[0], bottom - top, right - left)
        centers = [
            c + (start + (n - 1) / 2 - (whole - 1) / 2) * d
            for c, start, n, whole, d in zip(
                self.whole.center, starts, counts, self.whole.shape, self.whole.spacing, strict=True
            )
        ]
        return Grid(counts, self.whole.spacing, centers)


class ConeInput:
    """The projections of a cone-beam scan, and its geometry.

    Args:
        settings: what is to be done with it.
        file: the scan as its file has it.
        device: where to work.

    Raises:
        RiftError: an option does not fit the scan.
    """

    def __init__(self, settings: ReconstructSettings, file: ScanFile, device: Device) -> None:
        check_options(settings)
        check_center(settings.center, file)
        self.settings, self.file, self.device = settings, file, device
        self.watched = WatchedScan(file)
        # The scan as it is worked on.
        self.scan = binned_file(file, settings.binning)
        self.unit = file.unit
        # Bin of the axis on the detector as the file has it, where that is said or found.
        self.center = settings.center
        # Degrees by which the axis leans, and by which projections are turned.
        self.tilt = math.degrees(file.lean) if settings.tilt is None else settings.tilt
        # Whether the angles run the other way than the file was taken to say.
        self.turned = False
        self._axis_taken = False
        self.clean = CleanRows(self.scan, settings, None, device)
        self.notes: list[str] = [*file.notes]
        self.axis: dict[str, Any] = {}
        # Made now, so that what does not fit is told before any work.
        self.geometry = self._geometry()
        # No axis is looked for where there are vectors or a helix.
        circle = isinstance(self.geometry, Cone) and self.geometry.circular
        settled = settings.center is not None or not circle
        self.window = VolumeWindow.of(settings, self.geometry, settled=settled)
        # What air reads in the middle row, where that is surely not zero.
        self.air: BeamLevel | None = None
        # Slices below the volume and above it that rays meet, where the object goes on there.
        self.beyond = 0, 0
        self._check_memory()

    @property
    def grid(self) -> Grid:
        """The voxels that are wanted."""
        return self.window.grid

    @property
    def solved(self) -> Grid:
        """The voxels that a method needs: all that rays meet, where it explains every ray."""
        if not self.settings.iterative:
            return self.grid
        whole, (below, above) = self.window.whole, self.beyond
        z, y, x = whole.center
        middle = z + (above - below) / 2 * whole.spacing[0]
        shape = whole.shape[0] + below + above, *whole.shape[1:]
        return Grid(shape, whole.spacing, (middle, y, x))

    @property
    def part(self) -> tuple[slice, ...]:
        """Where in the voxels that are solved for those that are wanted lie."""
        if not self.settings.iterative:
            return (slice(None),) * 3
        left, right, top, bottom = self.window.roi
        first, stop = (number + self.beyond[0] for number in self.window.slices)
        return slice(first, stop), slice(top, bottom), slice(left, right)

    def read(self, first: int = 0, stop: int | None = None) -> Attenuation:
        """Line integrals of some rows, corrected; of all if none are named.

        Raises:
            InputError: the scan was changed since it was opened.
        """
        found = self.clean.read(first, self.scan.shape[1] if stop is None else stop)
        self.watched.check()
        return found

    def identity(self) -> dict[str, Any]:
        """The file and the geometry, which decide the volume besides the settings."""
        axis = {"axis": repr(self.center), "tilt of the axis": repr(self.tilt)}
        axis["angles"] = "reversed" if self.turned else "as given"
        return {**self.watched.identity(), **axis, "geometry": self.geometry.digest}

    def take(self, axis: tuple[float, float, bool] | None) -> None:
        """Take the axis that was found when the run began, in place of a search.

        Args:
            axis: its bin, its tilt in degrees, and whether angles were reversed; None where the
                run had none to find.
        """
        if axis is not None and self.settings.center is None:
            (self.center, self.tilt, self.turned), self._axis_taken = axis, True

    def locate(self) -> None:
        """Find the axis and the sense of rotation, unless they are said, and say what is done."""
        self.axis = self._found_axis()
        middle = self.scan.shape[1] // 2
        read = self.clean.read(middle, middle + 1)
        self.notes += row_doubts(self.scan, middle, read)
        self.air = beam_level(read.projections[:, 0])
        self.geometry = self._geometry()
        self.window = VolumeWindow.of(self.settings, self.geometry)
        if self.tilt and isinstance(self.geometry, Cone):
            row, bin = self.geometry.center
            tilt, aspect = math.radians(self.tilt), self.scan.aspect
            self.clean.alignment = Alignment(bin, row, tilt, aspect=aspect)
        self.beyond = self._slices_beyond()
        self._check_memory()
        self._say()

    def _slices_beyond(self) -> tuple[int, int]:
        rows, scan = self.scan.shape[1], self.geometry
        if not self.settings.iterative and (isinstance(scan, Vectors) or np.ptp(scan.heights)):
            # The formula of a helix says itself which slices it knows.
            return 0, 0
        air = 0 if self.air is None else self.air.levels.astype(np.float32)[:, None]
        first, middle, last = (
            self.clean.read(row, row + 1).projections[:, 0] - air
            for row in (0, rows // 2, rows - 1)
        )
        below, above = slices_beyond(scan, self.window.whole)
        return below * goes_on(first, middle), above * goes_on(last, middle)

    def _say(self) -> None:
        n, (_, rows, bins) = self.settings.binning, self.file.shape
        if n > 1:
            block = row_binning(self.file, n)
            lost = binning_note(rows, bins, rows=block, bins=n)
            averaged = f"Blocks of {block} x {n} (rows x bins) detector pixels were averaged."
            self.notes.append(f"{averaged} {lost}".rstrip())
        self.notes += self.clean.notes() + self._pitch_note() + self._orbit_note()
        self.notes += unchecked_helix(self.file)
        if any(self.beyond):
            self.notes.append(self._beyond_note())
        if self.scan.background:
            self.notes.append(
                f"The mean of the outermost {self.scan.background} bins at each end (air) was "
                "subtracted."
            )

    def _orbit_note(self) -> list[str]:
        """A doubt, where no row sees the plane of the source's orbit, which is seldom so."""
        cone, rows = self.file.cone, self.file.shape[1]
        if not isinstance(cone, Cone) or -0.5 <= cone.center[0] <= rows - 0.5:
            return []
        return [
            f"Doubt: the geometry has the source's orbit at row {cone.center[0]:g}, off the "
            f"detector's rows 0 to {rows - 1}: 'center' is the row of the orbit and then the bin "
            "of the axis."
        ]

    def _pitch_note(self) -> list[str]:
        """What takes the place of the file's pitch, which is seldom meant."""
        given, cone = self.settings.pitch, self.file.cone
        if given is None or not isinstance(cone, Cone) or math.isclose(given, cone.pitch[1]):
            return []
        return [
            f"--pitch {given:g} takes the place of {cone.pitch[1]:g}, the distance between bins in "
            "the file; distances of the source stay those of the file."
        ]

    def _beyond_note(self) -> str:
        named = zip(self.beyond, ("first", "last"), ("lower", "upper"), strict=True)
        ends = [end for end in named if end[0]]
        rows = " and the ".join(row for _, row, _ in ends)
        seen = " and ".join(f"{_slices(count)} at the {end} end" for count, _, end in ends)
        further = " As many beyond them were solved for and are left out."
        return (
            f"The object reaches beyond the {rows} row, so that not all views see {seen} of the "
            f"volume: their values are less certain.{further if self.settings.iterative else ''}"
        )

    def _found_axis(self) -> dict[str, Any]:
        """Bin of the axis on the detector as the file has it, and how it is known."""
        if self._axis_taken:
            return {"center": self.center, "by": "search"}
        settings = self.settings
        axis = axis_of_cone(
            self.file, settings.center, settings.tilt, self.device, zingers=settings.zingers
        )
        self.center, self.tilt, self.turned = axis.center, axis.tilt, axis.turned
        self.notes += axis.notes
        return axis.record

    def _geometry(self) -> Cone | Vectors:
        """The file's geometry with the axis and the pitch that are said or found."""
        scan, settings = self.scan.cone, self.settings
        assert scan is not None
        if not isinstance(scan, Cone):
            changes = {name: getattr(settings, name) for name in ("center", "pitch", "tilt")}
            given = [name for name, value in changes.items() if value is not None]
            if not given:
                return scan
            raise InputError(
                f"{self.file.path}: --{given[0]} does not apply to a scan that vectors describe: "
                "mend the vectors (--geometry)"
            )
        row, bin = scan.center
        pitch = scan.pitch
        if self.center is not None:
            bin = binned_center(self.center, settings.binning)
        if settings.pitch is not None:
            scale = settings.pitch * settings.binning / pitch[1]
            pitch = pitch[0] * scale, pitch[1] * scale
        lengths = scan.source_to_axis, scan.source_to_detector
        return Cone(
            -scan.angles if self.turned else scan.angles,
            scan.rows,
            scan.bins,
            pitch,
            *lengths,
            (row, bin),
            scan.heights,
            scan.curved,
        )

    @property
    def _need(self) -> int:
        """Bytes that the method takes of host and device together."""
        volumes, stacks = _HELD[self.settings.method]
        if self.settings.method == "fbp" and isinstance(self.geometry, Vectors):
            stacks *= FINER
        return 4 * (
            volumes * int(np.prod(self.solved.shape)) + stacks * int(np.prod(self.scan.shape))
        )

    @property
    def part_budget(self) -> int | None:
        """Bytes for parts of the volume, where it is worked on in such; None where all fits."""
        budget, method = self.device.budget, self.settings.method
        if self._need <= budget:
            return None
        left = budget - 4 * _HELD_BESIDE_PARTS[method] * int(np.prod(self.scan.shape))
        # A slab is on the host as well, and is half of what the device holds for it at most.
        return left if self.settings.iterative else left * 2 // 3

    def _check_memory(self) -> None:
        """Refuse what does not fit before anything is read.

        Raises:
            ResourceLimitError: the projections are larger than the budget.
        """
        need, left = self._need, self.part_budget
        if left is not None and left <= 0:
            raise ResourceLimitError(
                f"{self.file.path}: a volume of {self.solved.shape} from projections of "
                f"{self.scan.shape} takes {format_bytes(need)}, the memory budget is "
                f"{format_bytes(self.device.budget)}: average pixels (--binning 2), take larger "
                "voxels (--pixel), or reconstruct a part (--rows, --roi)"
            )


def _slices(count: int) -> str:
    return f"{count} slice{'' if count == 1 else 's'}"


def check_options(settings: ReconstructSettings) -> None:
    """Refuse options that cones have no use for.

    Raises:
        InputError: one is given.
    """
    for name, unused in _REFUSED.items():
        if getattr(settings, name) != unused:
            option = name.replace("_", "-")
            raise InputError(f"--{option} does not apply to cone-beam scans: leave it out")
    if settings.pad == "on":
        raise InputError("--pad on does not apply to cone-beam scans: leave it out")
    if settings.method == "levels":
        raise InputError(
            "--method levels does not apply to cone-beam scans: choose fbp, cgls, sirt or tv"
        )
    if settings.footprint == "joseph":
        raise InputError(
            "--footprint joseph does not apply to cone-beam scans: choose strip or linear"
        )
    if settings.compensate not in (None, "uniform", "voronoi"):
        raise InputError(
            f"--compensate {settings.compensate} does not apply to cone-beam scans: choose uniform "
            "or voronoi"
        )


def decided_cone_settings(
    source: ConeInput, values: tuple[float, float] | None
) -> ReconstructSettings:
    """The settings with a value for everything that was left open.

    Args:
        source: the scan; read.
        values: what the integers of the volume stand for; None for floating samples.
    """
    from rift_cl.commands.reconstruct.decided import filter_settings

    settings, window = source.settings, source.window
    lengths = scan_lengths(source.geometry)
    decided: dict[str, Any] = {
        "scan": source.file.path,
        "kind": source.file.kind,
        "out": settings.out.absolute(),
        "rings": source.clean.rings or "off",
        "pad": "off",
        "rows": window.slices,
        "unit": source.unit,
        "pixel": window.pixel,
        "size": window.whole.shape[-1],
        "background": source.file.background,
        "window": values,
    }
    if isinstance(source.file.cone, Cone):
        decided["center"] = source.axis["center"]
        decided["pitch"] = lengths.pitch[1] / settings.binning
        decided["tilt"] = source.tilt
        decided["reversed"] = settings.reversed != source.turned
    if settings.geometry is not None:
        decided["geometry"] = settings.geometry.absolute()
    if settings.iterative:
        decided["steps"] = settings.most_steps
    if settings.method == "fbp":
        decided |= filter_settings(settings)
    return dataclasses.replace(settings, **decided)
