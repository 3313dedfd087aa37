"""The projections of a fit to X-rays: read, corrected, in one scale, as views of cameras.

A fit works in lengths of detector bins, as they are seen at the rotation axis, and in shares of the
strongest line integrals, so that its rates and its noise mean the same for every scan; what is left
in the run's folder has the scan's units again. Parallel beams are orthographic cameras, cone beams
pinholes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.inputs.axis_alignment import Alignment
from rift_cl.commands.inputs.beam_level import beam_level
from rift_cl.commands.inputs.detector_rows import dead_rows_words
from rift_cl.commands.inputs.row_doubts import row_doubts
from rift_cl.commands.inputs.scan_axis import find_axis, tilt_worth_turning
from rift_cl.commands.inputs.scan_identity import WatchedScan
from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.inputs.scan_lengths import BIN, with_lengths
from rift_cl.commands.inputs.scan_rows import (
    check_center,
    chosen_rows,
    read_attenuation,
)
from rift_cl.commands.inputs.told_axis import (
    axis_of_cone,
    doubted_parallel,
    found_in_words,
    offset_in_words,
    unchecked_helix,
)
from rift_cl.commands.inputs.told_lacks import missing_directions, missing_rays
from rift_cl.errors import InputError
from rift_cl.geometry import Camera, Cone, Grid, Parallel, Vectors
from rift_cl.geometry.scan_cameras import ScanCameras, scan_cameras
from rift_cl.geometry.seen_grid import check_axis, scan_lengths, seen_grid
from rift_cl.io.boundary import check_claim
from rift_cl.io.images.display_light import LightKind
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct.direct.offset_axis import is_offset, seen_bins

# Line integrals are measured by the value that this share of them stays below.
_STRONG = 0.999
# Volumes of float64 that start, slices and scores take together, and stacks of projections.
_VOLUMES, _STACKS = 5, 5
# Stacks of float64 of the views that densities are solved for.
_SOLVED = 6

Floats = NDArray[np.float32]


class XrayInput:
    """A scan that a fit will read.

    Args:
        settings: where it is and how it is read.
        device: where the rotation axis is looked for.

    Raises:
        RiftError: the scan cannot be read, or an option does not fit it.
    """

    def __init__(self, settings: FitXraySettings, device: Device) -> None:
        self.source = ScanInput(
            settings.capture,
            dataset=settings.dataset,
            theta=settings.theta,
            flats=settings.flats,
            darks=settings.darks,
            image_key=settings.image_key,
            kind=settings.kind,
            axes=settings.axes,
            angle_unit=settings.angle_unit,
            geometry=settings.geometry,
            reversed=settings.reversed,
            memory=settings.memory,
        )
        opened = self.source.open_scan(fan=True)
        self.watched = WatchedScan(opened)
        # Of cones --pitch is refused below.
        self.scan: ScanFile = with_lengths(
            opened,
            settings.pitch if opened.cone is None else None,
            settings.unit,
            settings.row_pitch,
        )
        if self.scan.fan is not None:
            raise InputError(
                f"{self.scan.path}: is a fan-beam scan, a fit takes parallel and cone beams; "
                "'rift reconstruct' takes fans as well"
            )
        self.settings, self.device = settings, device
        self._refuse_for_cones(settings)
        if isinstance(self.scan.cone, Vectors):
            # Here, where lengths are the file's; those of the grid are bins.
            check_axis(self.scan.cone)
        # What was found of the axis and has to be said of the rows, once they were read.
        self.notes: list[str] = []
        self.rows = chosen_rows(settings.rows, self.scan)
        check_center(settings.center, self.scan)
        # Bin of the rotation axis, degrees by which it leans, and whether the angles run the other
        # way than the file's: as they are said, and after ``read`` as they were found.
        self.center, self.tilt, self.turned = settings.center, settings.tilt or 0.0, False
        solve = settings.training.solve
        self._solved = solve.views if solve.every else 0
        self.pitch = self._length(settings)
        self.unit = self.scan.unit or (BIN if self.pitch == 1.0 else "")
        # Made now, so that a bad pitch is told before any work.
        Parallel(self.scan.angles, self.scan.shape[2], self.pitch, self.center)
        self._check_memory()

    def _refuse_for_cones(self, settings: FitXraySettings) -> None:
        """Refuse options whose meaning a cone beam's geometry has settled.

        Raises:
            InputError: one of them is given.
        """
        given = {"rows": settings.rows, "pitch": settings.pitch}
        if isinstance(self.scan.cone, Vectors):
            given |= {"center": settings.center, "tilt": settings.tilt}
        for name, value in given.items():
            if self.scan.cone is not None and value is not None:
                raise InputError(
                    f"--{name} is for parallel beams, {self.scan.path} is a cone-beam scan: its "
                    "rows belong together, and its lengths and axis are in its geometry "
                    "(--geometry)"
                )

    def _length(self, settings: FitXraySettings) -> float:
        """A bin as it is seen at the axis, in the scan's unit."""
        if self.scan.cone is not None:
            return scan_lengths(self.scan.cone).pixel[1]
        return (self.scan.pitch or 1.0) if settings.pitch is None else settings.pitch

    @property
    def grid(self) -> Grid:
        """The voxels of the slices that are written, in lengths of bins; final once it was read."""
        scan = self._geometry()
        if not isinstance(scan, Parallel):
            return seen_grid(scan, 1.0)
        across = seen_bins(scan) if is_offset(scan) else scan.bins
        return Grid((self.rows[1] - self.rows[0], across, across), (self.scan.aspect, 1.0, 1.0))

    @property
    def _row_pitch(self) -> float:
        """Distance between rows of parallel beams, in the scan's unit."""
        return self.pitch * self.scan.aspect

    @property
    def raised(self) -> float:
        """How much higher splats stand in the scan than in a fit, in the scan's unit.

        A fit of parallel beams has the middle of the rows at 0, the scan the detector's row 0; both
        have the source's orbit of a cone there.
        """
        if self.scan.cone is not None:
            return 0.0
        return (self.rows[0] + (self.rows[1] - self.rows[0] - 1) / 2) * self._row_pitch

    @property
    def dilation(self) -> tuple[float, float, float]:
        """Variance along (x, y, z), in bins squared, that splats gain where pixels show them."""
        aspect = 1.0 if isinstance(self.scan.cone, Vectors) else self.scan.aspect
        blur = self.settings.rendering.eps2d
        return blur, blur, blur * aspect**2

    def _check_memory(self) -> None:
        """Refuse rows of which a fit takes more memory than there is.

        Raises:
            InputError: they do.
        """
        check_claim(self.scan.path, "a fit of these rows", self.need, self.settings.budget())

    def first_sample(self, grid: Grid) -> tuple[float, float, float]:
        """Where the first voxel stands, in the scan's unit, as ``rift reconstruct`` has it.

        Args:
            grid: the voxels, in lengths of bins. Parallel beams leave open how high they are, so
                that heights count from the detector's row 0.
        """
        z, y, x = (self.pitch * float(grid.coordinates(axis)[0]) for axis in range(3))
        return (self.rows[0] * self._row_pitch if self.scan.cone is None else z), y, x

    @property
    def need(self) -> int:
        """Bytes of host memory that a fit takes."""
        views, rows, bins = len(self.scan.angles), self.rows[1] - self.rows[0], self.scan.shape[2]
        solved = 8 * _SOLVED * min(self._solved, views) * bins
        return 8 * _VOLUMES * math.prod(self.grid.shape) + rows * (
            4 * _STACKS * views * bins + solved
        )

    def read(self) -> Projections:
        """All line integrals, and the rotation axis.

        Raises:
            InputError: nothing is attenuated, or the axis cannot be found.
        """
        found, middle = read_attenuation(self.scan, *self.rows), sum(self.rows) // 2
        integrals, scale = found.projections, self._strongest(found.projections)
        row = found.of_row(middle - self.rows[0])
        self.notes = self._find_axis(row.projections[:, 0])
        if found.dead_rows:
            self.notes.append(dead_rows_words(found.dead_rows))
        self._check_memory()
        alignment = self._alignment()
        if alignment is not None:
            self.notes.append(alignment.words)
            integrals = self._aligned(alignment)
            scale = self._strongest(integrals)
        self.notes += self._offset_note() + self._lacks(integrals, row.projections[:, 0])
        remedy = "--loss l1 gives them less weight"
        self.notes += row_doubts(self.scan, middle, row, remedy=remedy)
        return Projections(self._geometry(), integrals / np.float32(scale), scale, self.grid)

    def _strongest(self, integrals: Floats) -> float:
        """What line integrals are measured by.

        Raises:
            InputError: nothing is attenuated.
        """
        scale = float(np.quantile(integrals, _STRONG))
        if scale <= 0:
            raise InputError(
                f"{self.scan.path}: the line integrals are {scale:g} at most, wanted some above 0: "
                "there is nothing to fit"
            )
        return scale

    def _find_axis(self, line: Floats) -> list[str]:
        """Find the axis, its tilt and a cone's sense of rotation, unless they are said.

        Args:
            line: line integrals of the middle one of the rows, (angle, bin).

        Returns:
            What is to be said of them, a sentence each.
        """
        scan, center, tilt = self.scan, self.settings.center, self.settings.tilt
        if scan.cone is not None:
            axis = axis_of_cone(scan, center, tilt, self.device)
            self.center, self.tilt, self.turned = axis.center, axis.tilt, axis.turned
            return [*axis.notes, *unchecked_helix(scan)]
        spanned, detector_rows = self.rows[1] - self.rows[0], scan.shape[1]
        if center is not None:
            away = sum(self.rows) // 2 - (detector_rows - 1) / 2
            return doubted_parallel(
                scan, line, center, self.tilt, away=away, spanned=spanned, device=self.device
            )
        found = find_axis(scan, self.device, rows=self.settings.rows)
        self.center = found.center
        if tilt is None:
            self.tilt = tilt_worth_turning(found, detector_rows)
        return found_in_words(found, detector_rows, spanned, tilt)

    def _alignment(self) -> Alignment | None:
        """How projections are turned, where the axis leans."""
        scan = self._geometry()
        if not self.tilt or isinstance(scan, Vectors):
            return None
        if isinstance(scan, Cone):
            row, bin = scan.center
        else:
            row, bin = (self.scan.shape[1] - 1) / 2, scan.center
        return Alignment(bin, row, math.radians(self.tilt), aspect=self.scan.aspect)

    def _aligned(self, alignment: Alignment) -> Floats:
        """Line integrals of the rows, turned so that the axis is at one bin of all of them."""
        _, detector_rows, bins = self.scan.shape
        halo = alignment.halo(bins)
        first, stop = max(0, self.rows[0] - halo), min(detector_rows, self.rows[1] + halo)
        around = read_attenuation(self.scan, first, stop).projections
        wanted = slice(self.rows[0] - first, self.rows[1] - first)
        return alignment.aligned(around, first, wanted, self.device)

    def _offset_note(self) -> list[str]:
        """What becomes of parallel rays of a turn whose axis is near the detector's end."""
        scan = self._geometry()
        if not isinstance(scan, Parallel) or not is_offset(scan):
            return []
        return [offset_in_words(scan.center, scan.angles, combined=False)]

    def _lacks(self, integrals: Floats, line: Floats) -> list[str]:
        """What of the object no view shows.

        Args:
            integrals: line integrals of all rows, (angle, row, bin).
            line: those of the middle one as it was read.
        """
        scan = self._geometry()
        told = missing_directions(scan.angles) if isinstance(scan, Parallel) else []
        # Vectors have no sides of an axis, and air that is off zero is no object that goes on.
        if isinstance(scan, Vectors) or beam_level(line) is not None:
            return told
        return told + missing_rays(integrals, scan)

    def _geometry(self) -> Parallel | Cone | Vectors:
        """The rays by what is known of the axis, in lengths of bins as they are seen at it."""
        cone = self.scan.cone
        if cone is None:
            return Parallel(self.scan.angles, self.scan.shape[2], 1.0, self.center)
        if isinstance(cone, Cone):
            center = cone.center if self.center is None else (cone.center[0], self.center)
            angles = -cone.angles if self.turned else cone.angles
            cone = dataclasses.replace(cone, angles=angles, center=center)
        return cone.scaled(1 / self.pitch)


@dataclass(frozen=True)
class Projections:
    """Line integrals of a parallel or a cone beam.

    Args:
        scan: the rays, in lengths of bins as they are seen at the axis.
        values: (V, rows, bins), times ``scale`` the line integrals.
        scale: what a value of one stands for.
        grid: the voxels of a reconstruction, as large as bins at the axis, of parallel beams as
            high as rows; those of some of the views are those of all.
    """

    scan: Parallel | Cone | Vectors
    values: Floats
    scale: float
    grid: Grid

    def of(self, numbers: Sequence[int]) -> Projections:
        """Some of the views."""
        chosen = list(numbers)
        return dataclasses.replace(self, scan=self.scan.subset(chosen), values=self.values[chosen])

    @property
    def angles(self) -> NDArray[np.float64]:
        """(V,) in radians; of vectors the directions that the sources stand in."""
        if isinstance(self.scan, Vectors):
            source = self.scan.source
            return np.asarray(np.arctan2(source[:, 0], -source[:, 1]), np.float64)
        return self.scan.angles

    @property
    def center(self) -> float | None:
        """Bin at which the rotation axis is seen; None for vectors."""
        if isinstance(self.scan, Vectors):
            return None
        return self.scan.center if isinstance(self.scan, Parallel) else self.scan.center[1]

    @property
    def reach(self) -> float:
        """Distance from the axis to the outermost ray of the detector's longer side, in bins."""
        if isinstance(self.scan, Parallel):
            center = self.scan.center
            return float(max(center + 0.5, self.values.shape[2] - 0.5 - center))
        return self.grid.shape[-1] / 2

    @property
    def flat(self) -> bool:
        """Whether there is but one detector row, which says nothing about what is across it."""
        return bool(self.values.shape[1] == 1)

    @cached_property
    def views(self) -> ScanCameras:
        """The cameras, and whose pictures are the projections with their rows in reverse."""
        if isinstance(self.scan, Parallel):
            return ScanCameras(tuple(self._ortho(self.scan)), np.zeros(len(self.values), bool))
        return scan_cameras(self.scan)

    def picture(self, number: int) -> Floats:
        """A projection as its camera sees it, (rows, bins)."""
        return flipped(self.values[number], self.views.reversed_rows[number])

    def _ortho(self, scan: Parallel) -> Iterator[Camera]:
        """Orthographic cameras: x along the detector, y along the rotation axis."""
        _, rows, bins = self.values.shape
        aspect = self.grid.spacing[0]
        K = [[1, 0, scan.center + 0.5], [0, 1 / aspect, rows / 2], [0, 0, 1]]
        for cos, sin in zip(np.cos(scan.angles), np.sin(scan.angles), strict=True):
            view = np.eye(4)
            view[:3, :3] = [[cos, sin, 0], [0, 0, 1], [sin, -cos, 0]]
            # All that any view sees lies before it.
            view[2, 3] = 2 * self.reach
            yield Camera((rows, bins), K, view, "ortho")


def flipped(image: Floats, reverse: bool) -> Floats:
    """An image with its rows in reverse, or as it is."""
    return np.ascontiguousarray(image[::-1] if reverse else image)


class XrayPictures:
    """Training views; see ``rift_cl.train.TrainingViews``.

    Args:
        device: where projections are sent.
        projections: the views.
    """

    light: LightKind = "display"

    def __init__(self, device: Device, projections: Projections) -> None:
        self.device = device
        self.projections = projections
        self.cameras: Sequence[Camera] = projections.views.cameras
        self.behind: Floats = np.zeros(3, np.float32)

    def begin(self, step: int) -> None:
        """Nothing depends on the step."""

    def target(self, number: int) -> Any:
        """(rows, bins, 1) line integrals on the device."""
        return self.device.array(self.projections.picture(number)[..., None])

    def weights(self, number: int) -> Any:
        """None: every ray counts."""
        return None

    def background(self, number: int) -> Any:
        """None: there is nothing behind X-rays."""
        return None
