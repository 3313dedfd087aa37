"""``rift fit``: posed photographs become splats, and a report that says how good they are."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Generator, Iterator, Sequence

from rift_cl.commands.cameras.arc import check_places, place_notes
from rift_cl.commands.cameras.fit_cameras import CAMERA_FILES, save_fit_cameras, with_poses
from rift_cl.commands.cameras.photograph_place import place_record
from rift_cl.commands.cameras.pose_check import check_poses
from rift_cl.commands.export.fit_page import leave_page
from rift_cl.commands.fit.inputs import FitInput, photograph_inputs
from rift_cl.commands.fit.probe import TRIED, probed, time_words
from rift_cl.commands.fit.run import FitRun
from rift_cl.commands.fit_photos.bare_input import BareInput
from rift_cl.commands.fit_photos.comparison import (
    compared_record,
    comparison_notes,
    trained_record,
)
from rift_cl.commands.fit_photos.photograph_size import (
    check_window,
    factor_for,
    fitting_downscale,
    size_words,
)
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.fit_photos.refined import (
    exposure_notes,
    exposure_record,
    pose_notes,
    pose_record,
)
from rift_cl.commands.fit_photos.report import (
    brightness_notes,
    doubt_notes,
    fit_page,
    history_notes,
    octave_notes,
    ramp_notes,
)
from rift_cl.commands.fit_photos.scores import error_record, score_record, score_views
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_photos.start import first_splats, start_notes
from rift_cl.commands.fit_photos.view_split import (
    EVERY,
    FEWEST_VIEWS,
    follows_lists,
    open_seen,
    split_photographs,
)
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import (
    Capture,
    View,
    camera_at,
    capture_name,
)
from rift_cl.io.captures.capture_notes import range_notes
from rift_cl.io.images.environment_map import write_environment_map
from rift_cl.io.scenes.scene_drawing import SceneDrawing
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.progress import Report
from rift_cl.splat.bands import FrameMemory
from rift_cl.splat.orders import ModeOrders
from rift_cl.splat.settings import SMALL_TILE
from rift_cl.train.loss.homogenisation import noise_of
from rift_cl.train.per_view.held_out_poses import placed_cameras
from rift_cl.train.strategy import DefaultSettings
from rift_cl.train.trainer import Trainer

# The group of photographs that the fit itself holds out.
_HELD_OUT = "held out"
# What to do about photographs that are smaller than SSIM's window.
_WITHOUT_SSIM = "do without it in the loss (--ssim-weight 0) and in scores (--hold-out 0)"
# Photographs from which the noise is estimated.
_NOISE_VIEWS = 8


class Fit(FitRun[FitPhotosSettings]):
    """A fit to photographs that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the capture cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: FitPhotosSettings) -> None:
        super().__init__(settings)
        self.source: Capture | BareInput
        if BareInput.fits(settings.capture):
            # Poses are looked for when the work begins, or were found before.
            self.source = BareInput(
                settings.capture, settings.out, frames=settings.frames, seed=settings.training.seed
            )
        else:
            self.source = open_seen(settings.capture, pinhole=settings.pinhole)
        self.downscale = settings.downscale or 1
        # What of the capture is not used, or may not be meant, a sentence each.
        self.capture_notes: tuple[str, ...] = ()
        self.training_views: tuple[View, ...] = ()
        self.test_views: tuple[View, ...] = ()
        # Every so-many-th is held out; None is by the capture's lists.
        self.hold_out = settings.hold_out
        if isinstance(self.source, Capture):
            self._split(self.source)
        self.tests = {
            capture_name(path): open_seen(path, pinhole=settings.pinhole) for path in settings.test
        }
        if len(self.tests) < len(settings.test):
            raise InputError("--test names two captures of the same name: rename one folder")
        if isinstance(self.source, Capture):
            self._check_sizes()

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        if isinstance(self.source, BareInput):
            return {
                "capture": self.source.words,
                "splats": self._splats,
                "device": self.device.name,
                **self._known_without_poses(self.source),
                **({"notes": "; ".join(self.source.notes)} if self.source.notes else {}),
            }
        cameras = [camera_at(view, self.downscale) for view in self.training_views]
        largest = max(camera.height * camera.width for camera in cameras)
        notes = self._notes()
        return {
            "capture": str(self.source.path),
            "trained on": f"{len(self.training_views)} photographs",
            "held out": f"{len(self.test_views)} photographs",
            "largest photograph": f"{largest} pixels, made smaller by {self.downscale}",
            **({"notes": "; ".join(notes)} if notes else {}),
            "splats": self._splats,
            "device": self.device.name,
            **self._tried(self.source, largest),
        }

    def _known_without_poses(self, source: BareInput) -> dict[str, str]:
        """How many photographs there are, their size and the memory that it takes."""
        sizes = source.sizes()
        if not sizes:
            return {}
        height, width = max(sizes, key=lambda size: size[0] * size[1])
        factor = self.settings.downscale or factor_for(height * width, self.device)
        small = max(width // factor, 1), max(height // factor, 1)
        memory = self._need(self._frame(small[0] * small[1])) / 2**20
        return {
            "photographs": f"{len(sizes)}, the largest of {width} x {height} pixels, fitted at "
            f"{small[0]} x {small[1]}",
            "device memory": f"{memory:.0f} MiB, and the tile lists",
            "time": "is known once the poses are, which COLMAP finds first",
        }

    def _tried(self, capture: Capture, pixels: int) -> dict[str, str]:
        """Memory and time, from a few steps that leave no trace."""
        settings = self.settings
        pictures, reading = self._timed_reading()
        most = settings.training.splats
        count = min(most, TRIED)
        few = dataclasses.replace(settings.training, splats=count)
        trainer = self._trainer(capture, pictures, dataclasses.replace(settings, training=few))
        probe, frame = probed(trainer, count), self._frame(pixels)
        first = round(len(trainer.parameters) * most / count)
        ahead = trainer.strategy.forecast(0, first)
        seconds = reading * len(self.training_views) + probe.steps(ahead)
        edge = settings.rendering.tile or SMALL_TILE
        lists = min(probe.lists(frame, edge), self.device.budget)
        return {
            "device memory": f"{self._need(frame) / 2**20:.0f} MiB, and about "
            f"{lists / 2**20:.0f} MiB of tile lists",
            "time": time_words(seconds),
        }

    def _timed_reading(self) -> tuple[CapturePictures, float]:
        """The photographs, and the seconds that it takes to read one."""
        begin = time.perf_counter()
        self._pictures(self.training_views[:1])
        reading = time.perf_counter() - begin
        return self._pictures(self.training_views), reading

    def _frame(self, pixels: int) -> FrameMemory:
        """Device memory of a frame, without its tile lists."""
        training = self.settings.training
        order, color_order = training.basis.orders
        channels = 3 if color_order else 0
        modes = None if training.basis.plain else ModeOrders(order, color_order, channels)
        absgrad = isinstance(training.strategy, DefaultSettings) and training.strategy.absgrad
        numbers = (training.splats, training.numbers, pixels, 3)
        light = training.environment.lobes if training.environment.shared else 0
        return FrameMemory(*numbers, gradient=True, absgrad=absgrad, modes=modes, environment=light)

    @staticmethod
    def _need(frame: FrameMemory) -> int:
        """Bytes of a step: besides what a frame takes there are Adam's two moments of all."""
        return frame.fixed + 8 * frame.parameters * frame.splats

    @property
    def _splats(self) -> str:
        """How many splats, and what they are."""
        training, words = self.settings.training, [f"at most {self.settings.training.splats}"]
        if training.angular.kind == "sh":
            words.append(f"harmonics of degree {training.degree}")
        return ", ".join([*words, *filter(None, [self.settings.basis_words()])])

    def _work(self) -> Iterator[Report]:
        settings = self.settings
        self.folder.make()
        capture, told = self.source, 0
        if isinstance(capture, BareInput):
            # Before the poses are looked for, which takes long and may not be what is wanted.
            told = self._tell(capture.notes)
            capture = yield from capture.find()
            self._split(capture)
            self._check_sizes()
        self._tell(self._notes()[told:])
        pictures = self._pictures(self.training_views)
        if settings.training.refine_exposures and pictures.any_cut_out():
            raise InputError(
                "--refine-exposures wants photographs of a whole scene: these are cut out, and "
                "what stands behind them was never exposed"
            )
        if pictures.nothing_in_front():
            self.announce(
                "rift: the photographs show nothing but their background: what is fitted will be "
                "empty. Check that these are the right pictures, and their alpha"
            )
        trainer = self._trainer(capture, pictures)
        yield from self._read_ahead(trainer, pictures)
        self.settled = dataclasses.replace(
            settings.decided(len(self.training_views)),
            training=trainer.settings,
            rendering=dataclasses.replace(settings.rendering, near=trainer.renderer.settings.near),
            hold_out=self.hold_out,
            downscale=self.downscale,
            first_splats=settings.first_share,
        )
        self.decided = {
            "photographs": place_record([*self.training_views, *self.test_views], settings.out)
        }
        self._begin(trainer)
        # A fit that goes on has them, those of scored photographs as they were refined last.
        there = all((settings.out / name).is_file() for name in CAMERA_FILES[:2])
        if not (trainer.parameters.step and there):
            self._keep_cameras(capture, trainer)
        yield from self._trained(trainer, pictures)
        if trainer.poses is not None:
            pictures = pictures.placed([trainer.camera(k) for k in range(len(pictures.views))])
        self._save_scene(trainer)
        for name, views in self._scored().items():
            yield from self._score(name, views, trainer, pictures)
        if trainer.poses is not None:
            self._keep_cameras(capture, trainer)
        splats = trainer.parameters.drawn
        self.scores = {name: scores for name, scores in self.scores.items() if scores}
        self.metrics = {
            "splats": len(splats),
            "loss": self.losses[-1][1],
            "history": self._history,
            "background": pictures.behind.tolist(),
            **settings.basis_facts(),
            **({} if trainer.octaves is None else {"octaves": trainer.octaves.facts()}),
            **pose_record(trainer),
            **exposure_record(trainer, self.training_views, self.scores),
            **score_record(self.scores),
            **compared_record(self.scores),
            **trained_record(self.scores),
            **error_record(self.scores),
        }
        ramp = ramp_notes(settings, len(self.training_views))
        held_out = self.scores.get(_HELD_OUT, [])
        doubts = [
            *comparison_notes(self.scores),
            *brightness_notes(held_out),
            *doubt_notes(held_out),
        ]
        refined = [*pose_notes(self.metrics), *exposure_notes(self.metrics)]
        self._tell([*refined, *doubts])
        octaves = octave_notes(self.metrics)
        history = history_notes(self._history)
        notes = [*self._notes(), *octaves, *ramp, *refined, *history, *doubts]
        scene = leave_page(settings.out, pictures, self.announce)
        name = capture_name(settings.capture)
        page = fit_page(name, self.scores, self.losses, self.metrics, notes, scene)
        self.folder.finish(
            self.settled, self.metrics, page, self.device, asked=settings, **self.decided
        )

    def _inputs(self) -> list[FitInput]:
        return photograph_inputs([*self.training_views, *self.test_views])

    def _score(
        self, name: str, views: tuple[View, ...], trainer: Trainer, training: CapturePictures
    ) -> Iterator[Report]:
        """Score a group of pictures, by cameras that are refined against them where the fit's are.

        They are given up with it, since each group may keep a share of the memory that is free.
        """
        test, given = self._pictures(views, training), None
        if trainer.poses is not None:
            given = test.cameras
            test = test.placed((yield from self._placed(name, trainer, test)))
            if name == _HELD_OUT:
                self.test_views = with_poses(self.test_views, test.cameras)
        self.scores[name] = []
        for score in score_views(
            *(trainer.renderer, trainer.parameters.drawn, test, training),
            given=given,
            exposed=trainer.exposures is not None,
        ):
            self.scores[name].append(score)
            yield Report(len(self.scores[name]), len(views), f"views of {name}")
            self._heed(trainer.parameters.step)

    def _placed(
        self, name: str, trainer: Trainer, test: CapturePictures
    ) -> Generator[Report, None, list[Camera]]:
        """The cameras of pictures that are scored, each refined against its picture."""
        cameras = list[Camera]()
        for camera in placed_cameras(trainer, test):
            cameras.append(camera)
            yield Report(len(cameras), len(test.views), f"poses of {name}")
            self._heed(trainer.parameters.step)
        return cameras

    def _save_scene(self, trainer: Trainer) -> None:
        """Leave the splats, and the light that they share, in the folder."""
        settings, drawn = self.settings, trainer.renderer.settings
        fitted = SplatScene.of(
            trainer.parameters.drawn,
            self.device,
            activation=drawn.activation,
            angular=drawn.angular,
            drawing=SceneDrawing(
                settings.light, drawn.antialiased, drawn.eps2d if drawn.antialiased else None
            ),
        )
        fitted.save(settings.out / "scene.ply")
        if fitted.environment is not None:
            display = settings.light == "display"
            path = settings.out / "environment.exr"
            write_environment_map(path, fitted.environment, display=display)

    def _read_ahead(self, trainer: Trainer, pictures: CapturePictures) -> Iterator[Report]:
        """Read the photographs that the steps will ask for, so that the first are as fast as all.

        Those for which there is no room are read whenever they are asked for.
        """
        count = min(len(pictures.views), self.steps)
        for step in range(count):
            if not pictures.keep(trainer.view_at(step)):
                return
            yield Report(step + 1, count, "photographs")
            self._heed(0)

    def _keep_cameras(self, capture: Capture, trainer: Trainer) -> None:
        """Leave the cameras in the folder as they are known, so that an unfinished fit has them."""
        out, training_views = self.settings.out, self.training_views
        if trainer.poses is not None:
            training_views = with_poses(
                training_views,
                [trainer.poses.camera(number) for number in range(len(training_views))],
            )
        self.folder.drop(*CAMERA_FILES)
        count = self.source.photographs if isinstance(self.source, BareInput) else None
        save_fit_cameras(out, capture, training_views, self.test_views, photographs=count)

    def _split(self, capture: Capture) -> None:
        settings = self.settings
        # Poses that are found here come with a sentence of how good they are.
        few = [] if isinstance(self.source, BareInput) else start_notes(capture)
        cameras = [view.camera for view in capture.views]
        self.capture_notes = (*capture.notes, *few, *place_notes(cameras))
        check_places(cameras, settings.capture)
        check_poses(cameras, capture.points, settings.capture)
        self.hold_out = settings.hold_out
        if self.hold_out is None and not follows_lists(capture.views):
            self.hold_out = EVERY
        hold_out = self.hold_out if len(cameras) > FEWEST_VIEWS else 0
        self.training_views, self.test_views = split_photographs(
            capture.views, hold_out, settings.views
        )
        decided = self.checkpoints.decided.get("downscale")
        self.downscale = decided or fitting_downscale(self.training_views, self.device)
        self.capture_notes += tuple(
            range_notes(self.training_views, downscale=self.downscale, light=settings.light)
        )

    def _check_sizes(self) -> None:
        """Make sure that SSIM can be had of all photographs that it is asked of."""
        in_loss = self.training_views if self.settings.training.ssim_weight else ()
        scored = (view for views in self._scored().values() for view in views)
        check_window([*in_loss, *scored], self.downscale, way_out=_WITHOUT_SSIM)

    def _tell(self, notes: Sequence[str]) -> int:
        """Say notes, and how many there were."""
        for note in notes:
            self.announce(f"rift: {note}")
        return len(notes)

    def _notes(self) -> list[str]:
        """What was decided about the photographs, and what of them is not used."""
        notes = list(self.source.notes) if isinstance(self.source, BareInput) else []
        notes += self.capture_notes
        if self.hold_out is None:
            notes.append(
                f"Trained on {len(self.training_views)} photographs, and "
                f"{len(self.test_views) or 'none'} held out, by the capture's own lists; "
                "--hold-out 8, say, takes every 8th instead"
            )
        if self.hold_out and not self.test_views:
            notes.append(
                f"None of the {len(self.training_views)} photographs was held out: of so few, each "
                "is needed"
            )
        masks = sum(view.mask is not None for view in self.training_views)
        if masks:
            notes.append(
                f"{masks} of {len(self.training_views)} photographs have a mask: black is left out"
            )
        if self.settings.downscale is None and self.downscale > 1:
            notes.append(size_words(self.training_views, self.downscale))
        return notes

    def _trainer(
        self, capture: Capture, pictures: CapturePictures, given: FitPhotosSettings | None = None
    ) -> Trainer:
        settings = given or self.settings
        count = len(pictures.views)
        training = settings.training.decided(count)
        first = first_splats(
            self.device,
            *(capture, pictures),
            count=training.splats,
            guessed=settings.first_count,
            seed=training.seed,
        )
        if training.needs_noise:
            few = evenly(count, _NOISE_VIEWS)
            noise = noise_of([pictures.image(number)[..., :3] for number in few])
            training = dataclasses.replace(training, noise=noise)
        trainer = Trainer(pictures, first, training, settings.rendering)
        pictures.announce(trainer.view_at)
        return trainer

    def _pictures(
        self, views: tuple[View, ...], like: CapturePictures | None = None
    ) -> CapturePictures:
        settings = self.settings
        return CapturePictures(
            self.device,
            views,
            downscale=self.downscale,
            seed=settings.training.seed,
            light=settings.light,
            like=like,
        )

    def _scored(self) -> dict[str, tuple[View, ...]]:
        """The pictures that are scored, by the name of their group."""
        groups = {_HELD_OUT: self.test_views} if self.test_views else {}
        return groups | {name: capture.views for name, capture in self.tests.items()}
