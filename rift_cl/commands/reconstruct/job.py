"""``rift reconstruct``: a scan goes in, quantitative slices come out.

Rows are read, corrected, reconstructed and kept a slab at a time, as many together as the memory
budget allows, so that the size of a scan is bounded by the disk alone, and that a run which was
cut off goes on where it was. The volume is put together meanwhile (``assembly``).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl import __version__
from rift_cl.cl.device import Device
from rift_cl.commands.reconstruct.assembly import Assembly, TakeSlab
from rift_cl.commands.reconstruct.clean_rows import LoadedRows
from rift_cl.commands.reconstruct.decided import decided_settings
from rift_cl.commands.reconstruct.inversion import Inversion
from rift_cl.commands.reconstruct.kept_slabs import (
    SlabFolder,
    check_same,
    finished_run,
    run_folder,
    stopped,
)
from rift_cl.commands.reconstruct.overlap import Behind, ahead
from rift_cl.commands.reconstruct.report import (
    PREVIEW_PICTURE,
    Preview,
    planned,
    reconstruction_page,
    write_preview,
)
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_input import SliceInput
from rift_cl.commands.reconstruct.spread import begun_workers, spread
from rift_cl.commands.reconstruct.tallied_run import TalliedRun
from rift_cl.commands.reconstruct.volume import (
    check_place,
    chosen_window,
    clipped_words,
    made_words,
    open_slices,
)
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.io.volumes import VolumeWriter, other_volumes
from rift_cl.progress import Report
from rift_cl.reconstruct import Attenuation

if TYPE_CHECKING:
    from rift_cl.cluster.beside import Beside
    from rift_cl.cluster.workers import Workers

# Slices from which a run by a formula is worth a look before it goes on.
_PREVIEW_FROM = 8

# What decides the slices and is found on the way.
_FOUND = ("axis", "tilt of the axis", "angles", "volume")
Floats = NDArray[np.float32]


class Reconstruction(TalliedRun):
    """A reconstruction that is planned: the input is open, nothing is written yet.

    Args:
        settings: what to do.
        file: the scan, where it was opened before.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """

    def __init__(self, settings: ReconstructSettings, file: ScanFile | None = None) -> None:
        settings.check()
        self.settings = settings
        self.device: Device = settings.open_device(settings.memory_limit)
        self.source: SliceInput = SliceInput(settings, self.device, file)
        self.inversion: Inversion = Inversion(settings, self.source, self.device)
        # Made now, so that a part that is not inside the slice is told before any work.
        self.kept = SlabFolder(settings.out / "slabs", self.shape)
        """The slices that are done."""
        self.folder = run_folder(settings, self.kept)
        self.metrics: dict[str, Any] = {}
        self.announce: Callable[[str], None] = lambda line: None
        # Whether the slabs that are there are this run's, and whether it found them there.
        self._ours, self._gone_on = False, False
        # What the integers of the volume stand for.
        self._values: tuple[float, float] | None = None
        # What the report shows of the slices, as they come.
        self._preview = Preview(self.shape[0])
        # Whether this run has left a picture of the middle slice.
        self._shown = False
        self._begin = time.perf_counter()

    @property
    def rows(self) -> tuple[int, int]:
        """First detector row, and the one after the last."""
        return self.source.rows

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the volume, (z, y, x); of a full turn's, once the axis is known."""
        return self.rows[1] - self.rows[0], *self.inversion.window.shape

    @property
    def block(self) -> int:
        """Slices that parts of the run are not cut between."""
        return 1

    @property
    def result(self) -> str:
        """What there is when it is done, and where."""
        if self.settings.preview:
            return (
                f"{self.settings.out / PREVIEW_PICTURE} shows the middle slice; all "
                f"{self.shape[0]} would take about {self.metrics['seconds_for_all']:.3g} s"
            )
        return made_words(self.settings)

    @property
    def decided(self) -> ReconstructSettings:
        """The settings with all that was decided; of a run whose axis is known."""
        return decided_settings(self.source, self.inversion, self._values)

    @cached_property
    def slabs(self) -> list[slice]:
        """Slices that are worked on together, counted from the first row that was asked for."""
        return self.inversion.slabs([slice(0, self.shape[0])])

    def plan(self) -> dict[str, str]:
        """What would be done, for ``--dry-run``; one slice is reconstructed to tell the time."""
        self._locate()
        return planned(self, self._seconds_per_slice() * self.shape[0])

    def run(self) -> Iterator[Report]:
        """Do it; a report after every slab, or after every step.

        Raises:
            StoppedError: it was broken off, and what was done is kept.
        """
        self._begin = time.perf_counter()
        if self.finished:
            self.announce(f"{self.settings.out}: the reconstruction is complete already")
            return
        if not self.settings.resume:
            yield Report(0, self._total, self._what)
        with begun_workers(self) as workers:
            self._settle()
            self.folder.make()
            try:
                if self.settings.preview:
                    yield from self._look()
                    self.folder.release()
                    return
                check_place(self.settings, self.source, self.inversion.window)
                if not self._gone_on:
                    self._ours = True
                    self.kept.begin(self._facts(), self.inversion.projection)
                with self._assembly() as assembly:
                    yield from self._work(workers, assembly)
                    self.source.watched.check()
                    assembly.complete()
            except BaseException as error:
                if not self._keep_what_is_done():
                    self.folder.discard()
                elif isinstance(error, KeyboardInterrupt):
                    raise stopped(self.kept) from None
                raise
            self._finish(assembly)

    def _settle(self) -> None:
        """Find the axis, and whether there is something to go on with; nothing is written.

        Raises:
            InputError: the axis cannot be found, or a part that is wanted is not in the slice.
            CheckpointError: what there is to go on with belongs to another run.
        """
        going_on = self.settings.resume and self.kept.begun
        if going_on:
            self._take_found()
        # What is assumed of the file is told first: where no axis is found, it may be why.
        of_file = len(self.source.notes)
        for note in self.source.notes:
            self.announce(note)
        self._locate()
        if going_on and not self.settings.preview:
            self.kept.go_on(self._facts())
            self._ours = self._gone_on = True
        if self._gone_on:
            self.source.notes.append(
                f"Gone on after {self.kept.done} of {self.shape[0]} slices; steps, seconds and "
                "dead pixels are those of the rest."
            )
        for note in self.source.notes[of_file:]:
            self.announce(note)

    def join(self) -> None:
        """Get ready to do a part of a run that another process has begun, about the axis it found.

        Raises:
            CheckpointError: the run is not this one.
        """
        self._take_found()
        # That process has told its doubts.
        self._locate(doubt=False)
        self.kept.go_on(self._facts())

    def _take_found(self) -> None:
        """Take what was found when the run began: the axis, unless it is said, and the projector.

        What is made with more or less memory than there was is then made in the same way.
        """
        self.inversion.settings = dataclasses.replace(self.settings, **self.kept.projection())
        axis = self.kept.axis() if self.settings.center is None else None
        if axis is not None:
            self.source.center, self.source.tilt, self.source.turned = axis

    def _locate(self, *, doubt: bool = True) -> None:
        """Find the axis, and tell before any other work, this search too, that memory is short."""
        if not self.source.settled:
            self.inversion.check_memory()
        self.source.locate(doubt=doubt)
        # The axis decides how large slices are, where that is not said.
        self.kept.shape = self.shape
        self.inversion.slabs([slice(0, 1)])

    @cached_property
    def finished(self) -> bool:
        """Whether ``--resume`` met a run that had come to its end.

        Raises:
            CheckpointError: that run would have made other slices.
        """
        before = finished_run(self.settings) if self.settings.resume else None
        if before is None or self.kept.begun:
            return False
        now = {**self._facts(), **{name: before.get(name) for name in _FOUND}}
        check_same(self.settings.out, "the finished run", before, now)
        return True

    def _facts(self) -> dict[str, Any]:
        """What decides the slices."""
        return {
            "rift_cl": __version__,
            **self.settings.decisive(),
            **self.source.identity(),
            "volume": str(self.shape),
        }

    @property
    def _what(self) -> str:
        return "steps" if self.settings.iterative else "slices"

    @property
    def _total(self) -> int:
        return self.shape[0] * self.settings.most_steps

    @property
    def _looks_first(self) -> bool:
        count = self.shape[0]
        return count >= _PREVIEW_FROM or (self.settings.iterative and count > 1)

    def _assembly(self) -> Assembly:
        """The volume to be, which waits for all slices where they decide what integers mean."""
        self._preview = Preview(self.shape[0])
        return Assembly(
            self.kept,
            self._opened_volume,
            self._preview.take,
            self._show_once,
            waits=self.settings.dtype != "float32" and self.settings.window is None,
        )

    def _opened_volume(self) -> VolumeWriter:
        self._values = self._value_window()
        return open_slices(self.settings, self.source, self.inversion.window, self._values)

    def _work(self, workers: Beside[Workers] | None, assembly: Assembly) -> Iterator[Report]:
        """Every slice that is missing; first, of a long run, the middle one to look at."""
        # Less those of the row that the axis was looked for in.
        self.source.clean.zingers = 0
        if not self._gone_on and self._looks_first and workers is None:
            yield from self._look()
        if self._gone_on:
            # Where it goes on, so that nobody takes what was done before for this run's pace.
            yield self.report(self.kept.done)
        if workers is None:
            yield from self.work_on(self.kept.missing(), assembly.keep)
            return
        yield from spread(self, workers, assembly)

    def work_on(self, runs: list[slice], keep: TakeSlab) -> Iterator[Report]:
        """Reconstruct runs of slices, a slab at a time; a report after each.

        Args:
            runs: slices, counted from the first row that was asked for.
            keep: keeps a slab; called in another thread, one slab at a time.
        """
        done = self.kept.done
        values = {} if self.source.center is None else {"center": self.source.center}
        with Behind() as behind, ahead(self.inversion.slabs(runs), self._load) as load:
            for slab, loaded in load:
                integrals = self.source.projections(loaded)
                slices = yield from self._slab(slab, integrals, done)
                behind.do(keep, slab.start, slices)
                done += slab.stop - slab.start
                yield self.report(done, values)

    def report(self, done: int, values: Mapping[str, float] | None = None) -> Report:
        """Where it stands after so many slices."""
        return Report(done * self.settings.most_steps, self._total, self._what, values or {})

    def _look(self) -> Iterator[Report]:
        """Reconstruct the middle slice and show it; alone, tell how long the others would take."""
        middle = self.shape[0] // 2
        slab = slice(middle, middle + 1)
        image = yield from self._slab(slab, self.source.projections(self._load(slab)), 0)
        path = self._show(image[0])
        if not self.settings.preview:
            self.kept.save(middle, image)
            self.announce(f"{path} shows the middle slice")
            yield Report(self.settings.most_steps, self._total, self._what)
            return
        # Not the time that it took, in which kernels were built.
        seconds = self._seconds_per_slice() * self.shape[0]
        self.metrics["seconds_for_all"] = seconds
        self.announce(f"{path} shows the middle slice; all take about {seconds:.3g} s")
        yield Report(self._total, self._total, self._what, {"seconds for all": seconds})

    def _show(self, image: Floats) -> Path:
        """Leave the middle slice as a picture."""
        path = self.settings.out / PREVIEW_PICTURE
        number = self.rows[0] + self.shape[0] // 2
        write_preview(path, image, f"slice {number}")
        self._shown = True
        return path

    def _show_once(self, start: int, block: Floats) -> None:
        """Leave the middle slice of a long run as a picture when it passes, unless there is one."""
        if self._looks_first and not self._shown and self._preview.middle is not None:
            self._show(self._preview.middle)

    def _load(self, slab: slice) -> LoadedRows:
        first = self.rows[0]
        return self.source.clean.load(first + slab.start, first + slab.stop)

    def _slab(
        self, slab: slice, integrals: Attenuation, before: int
    ) -> Generator[Report, None, Floats]:
        self._mended(integrals)
        steps = self.inversion.slices(self.rows[0] + slab.start, integrals.projections)
        done = before * self.settings.most_steps
        while True:
            try:
                report = next(steps)
            except StopIteration as end:
                slices: Floats = end.value
                # Before they are kept: what is kept is of the scan as it was opened.
                self.source.watched.check()
                return slices
            yield Report(done + report.done, self._total, self._what, report.values)

    def _finish(self, assembly: Assembly) -> None:
        """Make the report of the volume, which is there."""
        # Pictures want memory that the device keeps for arrays to come.
        self.device.release()
        statistics = self._preview.statistics()
        if self._values is not None:
            below, above = assembly.clipped
            self.metrics |= {"clipped_below": below, "clipped_above": above}
            reached = statistics["minimum"], statistics["maximum"]
            unit = self.source.unit if self.settings.attenuation else ""
            clipped = clipped_words((below, above), self._values, reached, unit)
            self._say(*[clipped] if clipped else [])
        # From here on the slices are this run's, and an earlier configuration no longer theirs.
        self.folder.mark()
        self.folder.drop(*other_volumes(self.settings.format))
        if not self._shown:
            assert self._preview.middle is not None
            self._show(self._preview.middle)
        if self.source.center is not None:
            self.metrics = {"center": self.source.center, **self.metrics}
        if self.settings.zingers is not None:
            self.metrics["zingers"] = self.source.clean.zingers
        self.metrics.update(self.inversion.figures())
        self.metrics.update(statistics)
        self.metrics["seconds"] = time.perf_counter() - self._begin
        self.metrics.pop("seconds_for_all", None)
        page = reconstruction_page(self, self._preview)
        record = {**self.metrics, "assumed": self.source.notes}
        facts = {"axis": self.source.axis, "run": self._facts()}
        self.folder.finish(self.decided, record, page, self.device, asked=self.settings, **facts)
        self.kept.drop()

    def _value_window(self) -> tuple[float, float] | None:
        """What the integers of the volume stand for, from a few slices where it was not said."""
        if self.settings.dtype == "float32" or self.settings.window is not None:
            return self.settings.window
        images = self.kept.slices(self._preview.numbers)
        parts = (slab for _, slab in self.kept.slabs())
        values, sentence = chosen_window(self.settings, images, parts)
        self._say(sentence)
        return values

    def _keep_what_is_done(self) -> bool:
        """After a failure: whether slices are kept; else the traces of the run are removed."""
        if not self._ours:
            return False
        if self._gone_on or self.kept.done:
            return True
        self.kept.drop()
        return False

    def _seconds_per_slice(self) -> float:
        first = self.rows[0]
        begin = time.perf_counter()
        integrals = self.source.read(first, first + 1)
        reading = time.perf_counter() - begin
        return reading + self.inversion.seconds(integrals.projections)
