"""``rift fit xray``: the projections of a parallel or a cone beam become Gaussian densities."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.fit.inputs import FitInput, scan_inputs
from rift_cl.commands.fit.probe import TRIED, probed, time_words
from rift_cl.commands.fit.run import FitRun
from rift_cl.commands.fit_photos.report import history_notes
from rift_cl.commands.fit_photos.scores import score_record
from rift_cl.commands.fit_photos.view_split import split_views
from rift_cl.commands.fit_xray.input import Projections, XrayInput, XrayPictures
from rift_cl.commands.fit_xray.negative_doubt import lowest_missed, negative_note
from rift_cl.commands.fit_xray.report import xray_page
from rift_cl.commands.fit_xray.scores import (
    backprojected,
    drawn,
    first_volume,
    relative_error,
    score_projections,
    stand_in_note,
)
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.io.scenes.splat_scene import SplatScene, XrayScene
from rift_cl.io.volumes import VOLUME_NAMES, open_volume, other_volumes
from rift_cl.progress import Report
from rift_cl.splat.splats import Splats
from rift_cl.splat.voxels import voxelise
from rift_cl.train.loss.homogenisation import noise_of
from rift_cl.train.parameters import Parameters
from rift_cl.train.start.xray import density_splats
from rift_cl.train.xray.trainer import XrayTrainer, volume_extent
from rift_cl.train.xray.voxels import Footprints
from rift_cl.train.xray.widening import Densities, widened

# Standard deviations of splats at the start, as a share of the gaps between them.
_SIZE = 0.8
# Rows from which the noise is estimated, and projections that tell how good the start is.
_FEW = 8

Floats = NDArray[np.float32]


class XrayFit(FitRun[FitXraySettings]):
    """A fit to projections that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the scan cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: FitXraySettings) -> None:
        super().__init__(settings)
        self.input = XrayInput(settings, self.device)
        numbers = tuple(range(self.input.scan.shape[0]))
        self.training_views, self.test_views = split_views(
            numbers, settings.hold_out, settings.views, what="projection"
        )

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        scan, rows = self.input.scan, self.input.rows
        bins, settings = scan.shape[2], self.settings
        measured = self._read().of(self.training_views)
        most = settings.training.splats
        tried = min(most, TRIED)
        few = dataclasses.replace(
            settings, training=dataclasses.replace(settings.training, splats=tried)
        )
        trainer = self._trainer(measured, XrayPictures(self.device, measured), few)
        seconds = self.steps * probed(trainer, tried).step(most)
        words = settings.basis_words()
        solves = ", and that of the solves" if settings.training.solve.every else ""
        return {
            "scan": f"{scan.path} ({scan.source}, {scan.kind})",
            "trained on": f"{len(self.training_views)} projections",
            "held out": f"{len(self.test_views)} projections",
            "rows": f"{rows[0]} to {rows[1] - 1}, {bins} bins each",
            "splats": ", ".join(filter(None, [str(most), words])),
            "output": f"scene.ply and {VOLUME_NAMES[settings.format]}, "
            f"{self.input.grid.shape} (z, y, x)",
            "host memory": f"{self.input.need / 2**20:.0f} MiB",
            "device": self.device.name,
            "time": time_words(seconds) + solves,
        }

    def _work(self) -> Iterator[Report]:
        if not self.settings.resume:
            yield Report(0, self.steps, "steps")
        whole = self._read()
        self.folder.make()
        measured = whole.of(self.training_views)
        pictures = XrayPictures(self.device, measured)
        trainer = self._trainer(measured, pictures)
        first = self._start_error(trainer, measured)
        self.settled = dataclasses.replace(
            self.settings.decided(len(self.training_views)),
            training=trainer.settings,
            rendering=dataclasses.replace(
                self.settings.rendering, near=trainer.renderer.settings.near
            ),
            **self._axis_facts(whole),
            **self._parallel_facts(),
            unit=self.input.unit,
            kind=self.input.scan.kind,
        )
        self._begin(trainer)
        yield from self._trained(trainer, pictures)
        splats, volume = trainer.parameters.drawn, backprojected(self.device, measured)
        if self.test_views:
            self.scores["held out"] = []
            held_out = whole.of(self.test_views)
            for score in score_projections(trainer.renderer, splats, held_out, measured, volume):
                self.scores["held out"].append(score)
                done = len(self.scores["held out"])
                yield Report(done, len(self.test_views), "projections held out")
                self._heed(trainer.parameters.step)
        self.metrics = {
            "splats": len(splats),
            "loss": self.losses[-1][1],
            "history": self._history,
            "center": whole.center,
            "scale": whole.scale,
            "start_error": first,
            **self.settings.basis_facts(),
            **score_record(self.scores),
        }
        voxels = self._voxels(splats, whole)
        missed = lowest_missed(trainer.renderer, splats, measured, voxels)
        density = whole.scale / self.input.pitch
        doubts = negative_note(missed, density, self.input.unit or "unit of length")
        for doubt in doubts:
            self.announce(doubt)
        self.input.notes += doubts
        self._leave(splats, volume, voxels, whole)

    def _inputs(self) -> list[FitInput]:
        found = scan_inputs(self.settings, self.input.scan.files, self.settings.out)
        # After the projections were read and their files looked at again.
        self.input.watched.check()
        return found

    def _read(self) -> Projections:
        """The projections, after what is to be said of them."""
        for note in self.input.scan.notes:
            self.announce(note)
        whole = self.input.read()
        self.input.notes += stand_in_note(self.device, whole.of(self.training_views))
        for note in self.input.notes:
            self.announce(note)
        return whole

    def _axis_facts(self, whole: Projections) -> dict[str, Any]:
        """The axis and the sense of rotation, as the options that say them to another fit."""
        if whole.center is None:
            return {}
        source, reversed = self.input, self.settings.reversed
        return {
            "center": whole.center,
            "tilt": source.tilt,
            "reversed": reversed != source.turned,
        }

    def _parallel_facts(self) -> dict[str, Any]:
        """Settings that were decided and apply to parallel beams alone."""
        if self.input.scan.cone is not None:
            return {}
        return {"rows": self.input.rows, "pitch": self.input.pitch}

    def _trainer(
        self, measured: Projections, pictures: XrayPictures, given: FitXraySettings | None = None
    ) -> XrayTrainer:
        settings = given or self.settings
        training = settings.training.decided(len(self.training_views))
        volume = first_volume(self.device, measured)
        raw = density_splats(
            volume,
            measured.grid,
            training.splats,
            seed=training.seed,
            dilation=self.input.dilation,
            size=_SIZE,
        )
        first = Parameters.of(self.device, raw, density=True)
        if training.needs_noise and min(len(self.training_views), measured.values.shape[2]) >= _FEW:
            few = evenly(measured.values.shape[1], _FEW)
            noise = noise_of([measured.values[:, row, :, None] for row in few])
            training = dataclasses.replace(training, noise=noise)
        return XrayTrainer(
            *(pictures, first, training, settings.rendering),
            flat=measured.flat,
            extent=volume_extent(measured.reach),
        )

    def _start_error(self, trainer: XrayTrainer, measured: Projections) -> float:
        """The relative error of a few training projections before the first step."""
        few = evenly(len(self.training_views), _FEW)
        splats, cameras = trainer.parameters.drawn, trainer.pictures.cameras
        images = [drawn(trainer.renderer, splats, cameras[number]) for number in few]
        truth = [measured.picture(number) for number in few]
        return relative_error(np.stack(images), np.stack(truth))

    def _leave(self, splats: Splats, volume: Floats, voxels: Floats, whole: Projections) -> None:
        """Write splats, slices and report, in the scan's units.

        The splats hold what projections widen them by: their sum is what slices and scores show.
        """
        settings, source, pitch = self.settings, self.input, self.input.pitch
        density = whole.scale / pitch
        scene = self._scene(splats)
        raised = np.array([0, 0, source.raised], np.float32)
        # Modes are shares of the peak, in units of the splats' axes: no unit changes them.
        dataclasses.replace(
            scene,
            means=scene.means * np.float32(pitch) + raised,
            log_scales=scene.log_scales + np.float32(log(pitch)),
            logit_opacities=scene.logit_opacities + np.float32(log(density)),
        ).save(settings.out / "scene.ply")
        slices = density * voxels
        path = settings.out / VOLUME_NAMES[settings.format]
        with open_volume(
            path,
            slices.shape,
            format=settings.format,
            spacing=tuple(pitch * edge for edge in whole.grid.spacing),
            unit=source.unit,
            origin=source.first_sample(whole.grid),
        ) as writer:
            writer.write(0, slices)
        self.folder.drop(*other_volumes(settings.format))
        shown = (slices, density * volume)
        notes = [*source.notes, *history_notes(self.metrics["history"])]
        name = source.scan.path.name
        about = (self.scores, self.losses, self.metrics, notes, source.unit)
        page = xray_page(name, shown, *about)
        self.folder.finish(self.settled, self.metrics, page, self.device, asked=settings)

    def _scene(self, splats: Splats) -> SplatScene:
        """Splats as wide as projections show them, or as they were trained where none are so."""
        scene = XrayScene.of(splats, self.device)
        narrow = Densities(*(getattr(scene, name) for name in Densities._fields))
        found = widened(narrow, self.input.dilation)
        if found is None:
            return dataclasses.replace(scene, eps2d=self.settings.rendering.eps2d)
        return dataclasses.replace(scene, **found._asdict(), eps2d=0.0)

    def _voxels(self, splats: Splats, whole: Projections) -> Floats:
        """The splats on the grid; plain ones to the last bits of fits from before modes."""
        if splats.shape_modes is not None:
            volume = voxelise(self.device, splats, whole.grid, dilation=self.input.dilation)
            return np.asarray(self.device.get(volume))
        names = ("means", "quats", "scales", "opacities")
        means, quats, scales, peaks = (
            self.device.get(getattr(splats, name)).astype(float) for name in names
        )
        footprints = Footprints(whole.grid, means, quats, scales, dilation=self.input.dilation)
        return footprints.sums(peaks).astype(np.float32)
