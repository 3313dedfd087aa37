"""``rift reconstruct`` of cone beams: all rows of all views become a volume at once.

No slice of a cone-beam scan is independent of its neighbours: every one needs all projections, and
these are in memory together. The volume need not be: where both do not fit, ``fbp`` and
``backproject`` make and write it in slabs, and methods that take steps keep it beside the device,
in memory or in temporary files, and work on parts of it. What does not fit is told before any work.
A formula's slabs may be made by the workers of a cluster, each from its rows (``cone_slabs``).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rift_cl import __version__
from rift_cl.cl.budget import format_bytes
from rift_cl.cl.device import Device
from rift_cl.commands.inputs.told_lacks import missing_rays
from rift_cl.commands.pictures.coverage_pictures import add_missed_planes
from rift_cl.commands.pictures.slice_pictures import display_window
from rift_cl.commands.reconstruct.assembly import Assembly, TakeSlab
from rift_cl.commands.reconstruct.cone_input import ConeInput, VolumeWindow, decided_cone_settings
from rift_cl.commands.reconstruct.cone_slabs import ConeSlabs
from rift_cl.commands.reconstruct.inversion import least_squares
from rift_cl.commands.reconstruct.kept_slabs import (
    SlabFolder,
    is_preview,
    refuse_begun,
    run_folder,
    stopped,
)
from rift_cl.commands.reconstruct.report import (
    PREVIEW_PICTURE,
    Preview,
    reconstruction_page,
    voxel,
)
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.spread import begun_workers, spread
from rift_cl.commands.reconstruct.tallied_run import TalliedRun
from rift_cl.commands.reconstruct.volume import (
    chosen_window,
    clipped_words,
    made_words,
    volume_path,
)
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import InputError
from rift_cl.geometry import Cone
from rift_cl.io.output import atomic_path
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.io.volumes import VolumeWriter, open_volume, other_volumes
from rift_cl.operators import Projector
from rift_cl.progress import Report
from rift_cl.reconstruct import FDK, Attenuation, Katsevich, poisson_weights
from rift_cl.reconstruct.direct.fdk import check_part
from rift_cl.reconstruct.direct.filtered_backprojection import (
    Backprojection,
    unfiltered_backprojection,
)
from rift_cl.reconstruct.direct.katsevich import cone_inversion
from rift_cl.reconstruct.direct.offset_axis import is_full_turn, sees_further
from rift_cl.reconstruct.direct.redundancy import ITERATE
from rift_cl.reconstruct.solvers.tv_problem import VariationSolver
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png, image_grid

if TYPE_CHECKING:
    from rift_cl.cluster.beside import Beside
    from rift_cl.cluster.workers import Workers

Floats = NDArray[np.float32]
Formula: TypeAlias = "FDK | Katsevich | Backprojection"
# Slices that are written together.
_WRITTEN = 16


@dataclasses.dataclass
class ConeInversion:
    """What the report asks of a method.

    Args:
        window: where the volume lies.
        residuals: root mean square of the residual after each step, under one number.
        weights: none: a volume that is solved for is made by one process.
    """

    window: VolumeWindow
    residuals: dict[int, list[float]] = dataclasses.field(default_factory=dict)
    weights: dict[int, float] = dataclasses.field(default_factory=dict)


class ConeReconstruction(TalliedRun):
    """A reconstruction of a cone-beam scan that is planned: nothing is read or written yet.

    Args:
        settings: what to do.
        file: the scan.
        joins: whether parts of a run are to be done that another process has begun.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """

    def __init__(
        self, settings: ReconstructSettings, file: ScanFile, *, joins: bool = False
    ) -> None:
        settings.check()
        self.settings = settings
        self.device: Device = settings.open_device(settings.memory_limit)
        self.source: ConeInput = ConeInput(settings, file, self.device)
        self.inversion: ConeInversion = ConeInversion(self.source.window)
        # Made now, so that a scan that the method does not take is told before any work.
        self.projector, self._formula = self._operators()
        self._check_parts()
        self.kept = SlabFolder(settings.out / "slabs", self.shape)
        """The slices that are done, where they are made slab by slab."""
        self.folder = run_folder(settings, self.kept) if joins else self._own_folder()
        self._gone_on = False
        self.metrics: dict[str, Any] = {}
        self.announce: Callable[[str], None] = lambda line: None
        self._values: tuple[float, float] | None = None
        # What the report and the picture show of the slices, as they come.
        self._preview, self._sections = Preview(self.shape[0]), _Sections(self.shape)
        self._begin = time.perf_counter()

    def _own_folder(self) -> RunFolder:
        settings = self.settings
        refuse_begun(settings, self.kept)
        # A preview alone is there to be followed by the slices.
        alone = is_preview(settings.out)
        begun = dataclasses.replace(settings, overwrite=True, resume=False) if alone else settings
        return RunFolder.of(begun, "reconstruct")

    @property
    def finished(self) -> bool:
        """Whether ``--resume`` met a run that had come to its end."""
        return self.folder.finished

    @property
    def rows(self) -> tuple[int, int]:
        """First slice, and the one after the last."""
        return self.source.window.slices

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the volume, (z, y, x)."""
        nz, ny, nx = self.source.grid.shape
        return nz, ny, nx

    @property
    def result(self) -> str:
        """What there is when it is done, and where."""
        if self.settings.preview:
            return f"{self.settings.out / PREVIEW_PICTURE} shows the middle slice"
        return made_words(self.settings)

    @property
    def decided(self) -> ReconstructSettings:
        """The settings with all that was decided."""
        return decided_cone_settings(self.source, self._values)

    @property
    def block(self) -> int:
        """Slices that parts of the run are not cut between."""
        return self._slabs.block

    @property
    def _slabs(self) -> ConeSlabs:
        if self._formula is None:
            raise InputError(
                "--cluster of a cone-beam scan is for --method fbp or backproject: a step needs "
                "the whole volume, so that it cannot be divided among workers"
            )
        return ConeSlabs(self.source, self._formula)

    def _operators(self) -> tuple[Projector, Formula | None]:
        """The projector of the voxels that are solved for, and the formula where it is one."""
        settings = self.settings
        options: dict[str, Any] = {"device": self.device}
        if settings.footprint is not None:
            options["footprint"] = settings.footprint
        if settings.iterative and self.source.part_budget is not None:
            # Of steps the device's share of the budget is all that it may use.
            options["device"] = settings.open_device(self.source.part_budget)
        A = Projector(self.source.solved, self.source.geometry, **options)
        return A, None if settings.iterative else self._formula_of(A)

    def _formula_of(self, A: Projector) -> Formula:
        """The formula that was asked for."""
        settings = self.settings
        if settings.method == "backproject":
            return unfiltered_backprojection(A)
        return cone_inversion(A, settings.view_filter(), settings.compensate)

    def _check_parts(self) -> None:
        """Refuse parts that find no room, or of which no window of values can be chosen."""
        settings, left = self.settings, self.source.part_budget
        if settings.cluster is not None:
            _ = self._slabs
        if left is None:
            return
        if self._formula is None:
            check_part(self.projector, left)
            check_part(self.projector.T, left)
            return
        self._formula.check_slabs(left)
        kept = settings.cluster is not None
        whole = settings.dtype == "float32" or settings.window is not None
        if not (whole or kept or settings.preview):
            raise InputError(
                f"--dtype {settings.dtype} wants --window LOW HIGH here: volume and projections do "
                f"not fit the memory budget of {format_bytes(self.device.budget)} at once, and a "
                "volume that is made in slabs has no window of values until it is written"
            )

    def _locate(self) -> None:
        """Find the axis, and make the operators again for it."""
        self.source.locate()
        self.inversion.window = self.source.window
        # The axis decides how large the volume is, where that is not said.
        self.kept.shape = self.shape
        self.projector, self._formula = self._operators()
        self._check_parts()
        if self._formula is not None and not isinstance(self._formula, Backprojection):
            self.source.notes.append(f"{self._formula.method}: {self._formula.sentence}.")
        if self.source.part_budget is not None:
            self.source.notes.append(
                "The volume is made in slabs of slices, since it does not fit the memory budget "
                "with its projections."
                if self._formula is not None
                else "What does not fit the memory budget is kept beside the device, in memory or "
                "in temporary files (TMPDIR), and the volume is solved for in parts."
            )

    def plan(self) -> dict[str, str]:
        """What would be done, for ``--dry-run``."""
        scan, device = self.source.scan, self.device
        self._locate()
        volume = 4 * int(np.prod(self.shape))
        return {
            "scan": f"{scan.path} ({scan.source}, {scan.kind})",
            "projections": f"{scan.shape} (angle, row, bin)",
            "volume": f"{self.shape} (z, y, x), {format_bytes(volume)}",
            "voxel": voxel(self),
            "method": self.settings.method,
            "assumed": " ".join(self.source.notes) or "nothing",
            "device": f"{device.name}, budget {format_bytes(device.budget)}",
            **({} if self.settings.cluster is None else {"workers": self.settings.cluster}),
            "output": str(volume_path(self.settings)),
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report after every step."""
        self._begin = time.perf_counter()
        if self.finished:
            self.announce(f"{self.settings.out}: the reconstruction is complete already")
            return
        total = 1 + self.settings.most_steps
        in_slabs = not self.settings.preview and self._in_slabs
        if not in_slabs:
            yield Report(0, total, "steps")
        elif not self.settings.resume:
            yield self.report(0)
        with begun_workers(self) as workers:
            if in_slabs and self._goes_on:
                self.source.take(self.kept.axis())
            # What is assumed of the file is told first: where no axis is found, it may be why.
            of_file = len(self.source.notes)
            for note in self.source.notes:
                self.announce(note)
            self._locate()
            if in_slabs and self._goes_on:
                self.kept.go_on(self._facts())
                self._gone_on = True
            for note in self.source.notes[of_file:]:
                self.announce(note)
            self.folder.make()
            try:
                if self.settings.preview:
                    self._show(self._middle_slice())
                    self.folder.release()
                    yield Report(total, total, "steps")
                    return
                self._check_place()
                if in_slabs:
                    self._finish((yield from self._kept_volume(workers)))
                    return
                integrals = self._read()
                self._mended(integrals)
                yield Report(1, total, "steps")
                slabs = yield from self._solve(integrals.projections, total)
                self._finish(self._whole_volume(slabs))
            except BaseException as error:
                if not self._keep_what_is_done():
                    self.folder.discard()
                elif isinstance(error, KeyboardInterrupt):
                    raise stopped(self.kept) from None
                raise
            yield Report(total, total, "steps")

    @property
    def _goes_on(self) -> bool:
        """Whether slabs that an earlier run kept are gone on with."""
        return self.settings.resume and self.kept.begun

    @property
    def _in_slabs(self) -> bool:
        """Whether the volume is made of slabs that are kept."""
        return self.settings.cluster is not None or self._goes_on

    def _facts(self) -> dict[str, Any]:
        """What decides the volume."""
        own = {"rift_cl": __version__, **self.settings.decisive(), **self.source.identity()}
        return {**own, "volume": str(self.shape)}

    def join(self) -> None:
        """Get ready to do a part of a run that another process has begun, about the axis it found.

        Raises:
            CheckpointError: the run is not this one.
        """
        self.source.take(self.kept.axis())
        self._locate()
        self.kept.go_on(self._facts())

    def _kept_volume(self, workers: Beside[Workers] | None) -> Generator[Report, None, Assembly]:
        """Make all slices that are missing, keep them, and put the volume together meanwhile."""
        self._check_sides(self._slabs.few_rows())
        self.source.clean.zingers = 0
        if not self._gone_on:
            self.kept.begin(self._facts())
        few = partial(self.kept.slices, self._preview.numbers)
        parts = (slab for _, slab in self.kept.slabs())
        waits = self.settings.dtype != "float32" and self.settings.window is None
        with self._assembly(few, parts, waits=waits) as assembly:
            if workers is None:
                yield from self.work_on(self.kept.missing(), assembly.keep)
            else:
                yield from spread(self, workers, assembly)
            self.source.watched.check()
            assembly.complete()
        return assembly

    def _whole_volume(self, slabs: Iterable[Floats]) -> Assembly:
        """Put the volume together of slabs that are not kept, from its first slice on."""

        def few() -> list[Floats]:
            # Volumes that come in several slabs have a window that was said (``_check_parts``).
            (volume,) = slabs
            return [volume[number] for number in self._preview.numbers]

        with self._assembly(few, slabs) as assembly:
            for start, block in _blocks(slabs):
                assembly.take(start, block)
        return assembly

    def work_on(self, runs: list[slice], keep: TakeSlab) -> Iterator[Report]:
        """Make runs of slices; a report after each part that found room.

        Args:
            runs: slices, counted from the first that is wanted.
            keep: keeps a part.
        """
        for run in runs:
            integrals = self._slabs.read(run)
            self._mended(integrals)
            for start, part in self._slabs.made(run, integrals.projections):
                keep(start, part)
                yield self.report(self.kept.done)

    def report(self, done: int, values: Mapping[str, float] | None = None) -> Report:
        """Where it stands after so many slices."""
        return Report(done, self.shape[0], "slices", values or {})

    def _keep_what_is_done(self) -> bool:
        """After a failure: whether slices are kept; else the traces of slabs are removed."""
        if not self._in_slabs or self.settings.preview:
            return False
        if self._gone_on or (self.kept.begun and self.kept.done):
            return True
        self.kept.drop()
        return False

    def _read(self) -> Attenuation:
        """Line integrals of all rows, whose sides a formula can take."""
        integrals = self.source.read()
        self._check_sides(integrals.projections)
        return integrals

    def _check_sides(self, projections: Floats) -> None:
        """Say where the object reaches beyond a side of the detector.

        Raises:
            InputError: no view shows what the shorter side of the detector does not.
        """
        scan = self.source.geometry
        if not isinstance(self._formula, FDK) or not isinstance(scan, Cone):
            return
        # Air that is off zero is no object that goes on.
        if self.source.air is not None:
            return
        told = missing_rays(projections, scan, "cgls, sirt and tv explain the rays")
        if told and sees_further(scan.center[1], scan.bins) and not is_full_turn(scan.angles):
            raise InputError(
                f"{self.source.file.path}: the object reaches beyond a side of the detector, whose "
                f"axis is at bin {scan.center[1]:.1f} of {scan.bins}, and the views do not go all "
                f"round, so that no view shows what is missing there; {ITERATE} (--method)"
            )
        self._say(*told)

    def _solve(self, projections: Floats, total: int) -> Generator[Report, None, Iterable[Floats]]:
        """The volume in slabs, or in one, after a report for every step."""
        left = self.source.part_budget
        if self._formula is not None:
            if left is not None:
                return self._formula.slabs(projections, left)
            return [np.asarray(self._formula(projections))]
        options: dict[str, Any] = {}
        if self.settings.weights is not None:
            options["weights"] = poisson_weights(projections).weights
        solver = least_squares(self.settings, self.projector, projections, **options)
        curve = self.inversion.residuals.setdefault(0, [])
        for report in solver.run(self.settings.most_steps):
            curve.append(report.values["residual"])
            yield Report(1 + report.done, total, "steps", report.values)
        volume = solver.data.home.host(solver.image)
        if isinstance(solver, VariationSolver):
            self.metrics["weight"] = solver.weight
        self.metrics |= {"steps": len(curve), "residual": curve[-1] if curve else 0.0}
        return [volume[self.source.part]]

    def _middle_slice(self) -> list[Floats]:
        """The middle slice alone, which a formula makes without the others."""
        if self._formula is None:
            raise InputError(
                "--preview of a cone-beam scan is for --method fbp or backproject: steps need the "
                "whole volume"
            )
        first, stop = self.rows
        middle = (first + stop) // 2
        settings = dataclasses.replace(self.settings, rows=(middle, middle + 1))
        grid = VolumeWindow.of(settings, self.source.geometry).grid
        A = Projector(grid, self.source.geometry, device=self.device)
        return [np.asarray(self._formula_of(A)(self._read().projections))[0]]

    def _assembly(
        self, few: Callable[[], list[Floats]], parts: Iterable[Floats], *, waits: bool = False
    ) -> Assembly:
        """The volume to be.

        Args:
            few: gives a few of its slices, which a window of values is chosen from.
            parts: the volume in parts, for the same.
            waits: whether that takes all slices.
        """

        def opened() -> VolumeWriter:
            self._values = self._value_window(few, parts)
            return self._open(self.settings, self._values)

        self._preview, self._sections = Preview(self.shape[0]), _Sections(self.shape)
        takers = self._preview.take, self._sections.take
        return Assembly(self.kept, opened, *takers, waits=waits)

    def _finish(self, assembly: Assembly) -> None:
        """Write the pictures and the report of the volume, which is there."""
        statistics = self._preview.statistics()
        if self._values is not None:
            below, above = assembly.clipped
            self.metrics |= {"clipped_below": below, "clipped_above": above}
            reached = statistics["minimum"], statistics["maximum"]
            unit = self.source.unit if self.settings.attenuation else ""
            clipped = clipped_words((below, above), self._values, reached, unit)
            self._say(*[clipped] if clipped else [])
        self.folder.mark()
        self.folder.drop(*other_volumes(self.settings.format))
        self._show(self._sections.planes)
        if self.settings.zingers is not None:
            self.metrics["zingers"] = self.source.clean.zingers
        self.metrics = {"center": self.source.axis["center"], **self.metrics}
        self.metrics.update(statistics)
        self.metrics["seconds"] = time.perf_counter() - self._begin
        record = {**self.metrics, "assumed": self.source.notes}
        facts = self._facts()
        self.folder.finish(
            self.decided,
            record,
            self._page(self._preview),
            self.device,
            asked=self.settings,
            axis=self.source.axis,
            run=facts,
        )
        self.kept.drop()

    def _page(self, preview: Preview) -> Page:
        page = reconstruction_page(self, preview)
        unit = self.source.unit or "unit of length"
        add_missed_planes(page, self.source.geometry, self.source.window.whole, unit=unit)
        return page

    def _value_window(
        self, few: Callable[[], list[Floats]], parts: Iterable[Floats]
    ) -> tuple[float, float] | None:
        """What the integers of the volume stand for, from a few slices where it was not said."""
        if self.settings.dtype == "float32" or self.settings.window is not None:
            return self.settings.window
        values, sentence = chosen_window(self.settings, few(), parts)
        self._say(sentence)
        return values

    def _open(
        self, settings: ReconstructSettings, values: tuple[float, float] | None
    ) -> VolumeWriter:
        grid = self.source.grid
        return open_volume(
            volume_path(settings),
            self.shape,
            format=settings.format,
            spacing=grid.spacing,
            unit=self.source.unit,
            origin=[float(grid.coordinates(axis)[0]) for axis in range(3)],
            dtype=settings.dtype,
            window=values,
            attenuation=settings.attenuation,
        )

    def _check_place(self) -> None:
        """Tell before the work, not after it, that the volume cannot be written."""
        plain = dataclasses.replace(self.settings, dtype="float32", window=None)
        with suppress(_PlaceFoundError), self._open(plain, None):
            raise _PlaceFoundError

    def _show(self, planes: list[Floats]) -> None:
        """Leave the middle planes across the three axes as a picture."""
        titles = ["z, across the axis", "y, along the axis", "x, along the axis"][: len(planes)]
        window = display_window(planes)
        figure = image_grid(planes, titles=titles, columns=len(planes), window=window, size=5.0)
        with atomic_path(self.settings.out / PREVIEW_PICTURE) as part:
            part.write_bytes(figure_png(figure))


def _blocks(slabs: Iterable[Floats]) -> Iterator[tuple[int, Floats]]:
    """Slices that are written together, and the first one's number."""
    first = 0
    for slab in slabs:
        for start in range(0, len(slab), _WRITTEN):
            block = np.ascontiguousarray(slab[start : start + _WRITTEN])
            yield first, block
            first += len(block)


class _Sections:
    """The middle planes across the three axes of a volume of which blocks of slices pass."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        nz, ny, nx = shape
        self._middle = nz // 2, ny // 2, nx // 2
        shapes = (ny, nx), (nz, nx), (nz, ny)
        self.planes: list[Floats] = [np.empty(each, np.float32) for each in shapes]

    def take(self, start: int, block: Floats) -> None:
        """Look at slices from number ``start`` on."""
        z, y, x = self._middle
        across, along_y, along_x = self.planes
        if start <= z < start + len(block):
            across[...] = block[z - start]
        along_y[start : start + len(block)] = block[:, y]
        along_x[start : start + len(block)] = block[:, :, x]


class _PlaceFoundError(Exception):
    """Leaves a volume that was opened only to see whether it can be."""
