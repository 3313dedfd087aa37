"""``rift eval``: score a scene on held-out photographs, or on other captures of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rift_cl.commands.cameras.fit_cameras import FitCameras, open_fit_cameras
from rift_cl.commands.cameras.pose_check import check_sight, unseen_notes
from rift_cl.commands.evaluate.report import eval_page
from rift_cl.commands.evaluate.settings import EvalSettings
from rift_cl.commands.fit_photos.comparison import (
    compared_record,
    comparison_notes,
    trained_record,
)
from rift_cl.commands.fit_photos.photograph_size import check_window
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.fit_photos.scores import (
    Floats,
    Mask,
    Score,
    ViewScore,
    error_record,
    score_record,
    score_views,
)
from rift_cl.commands.fit_photos.view_split import open_seen, split_views
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.commands.options import absolute_paths
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import InputError
from rift_cl.io.captures.capture import View, camera_at, capture_name, holds_bare_photographs
from rift_cl.io.captures.capture_notes import range_notes
from rift_cl.metrics import flip, flip_pixels
from rift_cl.metrics.perceptual import flip_evaluator
from rift_cl.progress import Report
from rift_cl.splat.renderer import Renderer

# Of what photographs a score has no meaning.
_WHY_NOT = {
    "flip": "whose pixels that count all lie within 10 pixels of ones that do not (a mask, or a "
    "lens), which its filters see as well",
    "lpips": "whose pixels do not all count (a mask, or a lens): it has no map that could be "
    "averaged over the others",
}


class Evaluation:
    """An evaluation that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the scene or a capture cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: EvalSettings) -> None:
        self.settings = settings
        if settings.hold_out < 0:
            raise InputError(f"--hold-out is {settings.hold_out}, wanted 0 or more")
        self.scene = settings.open_scene()
        chosen = settings.downscale
        self.downscale = self.scene.downscale if chosen is None else chosen
        # What is to be said of the captures, and of how pictures were scored, a sentence each.
        self.notes: list[str] = []
        self.cameras = self._cameras()
        self.groups = {capture_name(path): self._scored(path) for path in settings.captures}
        if not self.groups:
            self.groups = {"held out": self._held_out()}
        elif len(self.groups) < len(settings.captures):
            raise InputError("two captures have the same name: rename one folder")
        self.training_views = self._training_views()
        self.more = self._more()
        scored = [view for views in self.groups.values() for view in views]
        for view in [*self.training_views, *scored]:
            camera_at(view, self.downscale)
        check_window(scored, self.downscale)
        if settings.captures:
            self.notes += range_notes(scored, downscale=self.downscale, light=self.scene.light)
        self.device = settings.open_device()
        self.folder = RunFolder.of(settings, "eval")
        self.metrics: dict[str, Any] = {}
        self.scores: dict[str, list[ViewScore]] = {}
        # What pictures of each group are drawn over, in the scene's light.
        self.backgrounds: dict[str, Floats] = {}

    @property
    def decided(self) -> EvalSettings:
        """The settings with the values that were decided."""
        eps2d = self.scene.rendering.eps2d
        return replace(absolute_paths(self.settings), eps2d=eps2d, downscale=self.downscale)

    def _more(self) -> dict[str, Score]:
        """The scores that were asked for besides PSNR and SSIM.

        Raises:
            InputError: the package that one needs is missing, or its weights are.
        """
        more: dict[str, Score] = {}
        if self.settings.flip:
            flip_evaluator()
            more["flip"] = _flip
        if self.settings.lpips is not None:
            more["lpips"] = _lpips(self.settings.lpips)
        return more

    def _scored(self, path: Path) -> tuple[View, ...]:
        """The views of a capture that are scored.

        Raises:
            RiftError: it cannot be read, its poses are not those of its points, or it is the fit's
                own, whose photographs the fit knows.
        """
        fit, scene = self.scene.folder, self.settings.scene
        inside = fit is not None and path.resolve().is_relative_to(fit.resolve())
        if self.cameras is not None and (inside or holds_bare_photographs(path)):
            raise InputError(
                f"{path}: is no capture with photographs; to score the held-out photographs, name "
                f"only the fit: rift eval {scene}"
            )
        capture = open_seen(path, pinhole=self.scene.pinhole)
        views, every = capture.views, self.settings.hold_out
        check_sight([view.camera for view in views], capture.points, path)
        self.notes += capture.notes
        return views[::every] if every else views

    def _training_views(self) -> tuple[View, ...]:
        """Training views; empty if they are not known.

        Raises:
            RiftError: the capture of --train cannot be read, or has photographs that are scored.
        """
        if self.settings.train is None:
            return self._trained()
        views = open_seen(self.settings.train, pinhole=self.scene.pinhole).views
        training_views, _ = split_views(views, self.settings.hold_out, 0)
        both = self._in_both(training_views)
        if both is not None:
            raise InputError(
                f"{both} is also a training photograph (--train): leave --train out, or hold the "
                "scored ones out (--hold-out)"
            )
        return training_views

    def _cameras(self) -> FitCameras | None:
        """Those of the fit, whose photographs may have moved."""
        folder, moved = self.scene.folder, self.settings.photographs
        if folder is None or moved is None:
            return self.scene.cameras
        return open_fit_cameras(folder, photographs=moved)

    def _held_out(self) -> tuple[View, ...]:
        """The photographs that the fit held out."""
        where, cameras = self.settings.scene, self.cameras
        if self.settings.hold_out:
            raise InputError("--hold-out applies to captures: the fit knows what it held out")
        if cameras is None or self.scene.folder is None:
            why = "is no fit's folder" if self.scene.folder is None else "is of an older version"
            raise InputError(
                f"there is no capture to score: name one or more after the scene, since {where} "
                f"{why} and holds no cameras"
            )
        if not cameras.test_views:
            raise InputError(
                f"{where} held no photographs out: name a capture to score after the scene"
            )
        cameras.check_photographs(where)
        return cameras.test_views

    def _trained(self) -> tuple[View, ...]:
        """What the fit was trained on; empty where those photographs are gone."""
        cameras = self.cameras
        if cameras is None or not all(view.image.is_file() for view in cameras.training_views):
            return ()
        return cameras.training_views

    def _in_both(self, training_views: tuple[View, ...]) -> str | None:
        """A photograph that is scored and was trained on, with its capture's name."""
        files = {view.image.resolve() for view in training_views}
        scored = ((view, name) for name, views in self.groups.items() for view in views)
        names = (f"{view.name} of {name}" for view, name in scored if view.image.resolve() in files)
        return next(names, None)

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        scored = {f"score {name}": f"{len(views)} views" for name, views in self.groups.items()}
        trained = (
            f"{len(self.training_views)} views"
            if self.training_views
            else "not given: no baselines"
        )
        return {
            "scene": f"{self.scene.name}, {len(self.scene.splats)} splats",
            **scored,
            "trained on": trained,
            "downscale": str(self.downscale),
            "eps2d": f"{self.scene.rendering.eps2d:g}",
            "background": self._told
            or "the common border of the scored photographs, or black without one",
            **({"notes": "; ".join(self.notes)} if self.notes else {}),
            "scores": ", ".join(["PSNR", "SSIM", *(name.upper() for name in self.more)]),
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report for each picture."""
        renderer = Renderer(self.scene.rendering, device=self.device)
        splats = self.scene.splats.upload(self.device)
        training = self._pictures(self.training_views) if self.training_views else None
        self.folder.make()
        for name, views in self.groups.items():
            test = self._pictures(views, training)
            self.scores[name], self.backgrounds[name] = [], test.behind
            self.notes.append(self._background_note(name, test))
            exposed = self.scene.refined("exposures")
            for score in score_views(renderer, splats, test, training, self.more, exposed=exposed):
                self.scores[name].append(score)
                yield Report(len(self.scores[name]), len(views), f"views of {name}")
        self.scores = {name: scores for name, scores in self.scores.items() if scores}
        if not self.scores:
            raise InputError(f"{self.scene.name}: every mask is black, there is nothing to score")
        every = [score for scores in self.scores.values() for score in scores]
        self.notes += unseen_notes(sum(score.unseen for score in every), len(every))
        self.notes += [*self._pose_notes(), *self._exposure_notes(), *self._left_out()]
        self.notes += comparison_notes(self.scores)
        self.metrics = {
            "splats": len(self.scene.splats),
            "eps2d": self.scene.rendering.eps2d,
            "downscale": self.downscale,
            "background": {name: color.tolist() for name, color in self.backgrounds.items()},
            **score_record(self.scores),
            **compared_record(self.scores),
            **trained_record(self.scores),
            **error_record(self.scores),
        }
        page = eval_page(self.scene.name, self.scores, self.metrics, self.notes)
        self.folder.finish(self.decided, self.metrics, page, self.device, asked=self.settings)

    @property
    def _told(self) -> str | None:
        """Who says what is behind the splats; None where nobody does."""
        if self.settings.background is not None:
            return "as --background says"
        return None if self.scene.told_background is None else "the background of the fit"

    def _background_note(self, name: str, pictures: CapturePictures) -> str:
        """A sentence about what the pictures of a group are drawn over."""
        found = "black, since the photographs have no common border"
        if pictures.border is not None:
            found = "the common border of the photographs"
        color = in_display_light(pictures.behind, self.scene.light)
        shown = " ".join(f"{value:.3g}" for value in color)
        return f"pictures of {name} are drawn over {shown}, {self._told or found}"

    def _pose_notes(self) -> list[str]:
        """A sentence about whose poses the pictures are drawn with."""
        refined = self.scene.refined("poses")
        if self.settings.captures:
            note = "poses are those of the captures, whose frame is taken for that of the splats"
            moved = ", which the fit's poses may have moved away from" if refined else ""
            return [note + moved]
        if refined:
            return ["poses of the held-out photographs are those that the fit refined against them"]
        return []

    def _exposure_notes(self) -> list[str]:
        """A sentence about what of exposures is fitted to the pictures that are scored."""
        if not self.scene.refined("exposures"):
            return []
        return [
            "a gain and an offset of each colour are fitted to each photograph, as the fit did;"
            " 'as given' scores the splats without them"
        ]

    def _left_out(self) -> list[str]:
        """Sentences about pictures that a score has no meaning of."""
        scores = [score for group in self.scores.values() for score in group]
        lacking = {kind: sum(f"fit_{kind}" not in s.values for s in scores) for kind in self.more}
        return [
            f"{kind.upper()} is left out for {count} of {len(scores)} photographs, {_WHY_NOT[kind]}"
            for kind, count in lacking.items()
            if count
        ]

    def _pictures(
        self, views: tuple[View, ...], like: CapturePictures | None = None
    ) -> CapturePictures:
        return CapturePictures(
            self.device,
            views,
            downscale=self.downscale,
            light=self.scene.light,
            like=like,
            background=self.scene.told_background,
        )


def _flip(image: Floats, truth: Floats, counted: Mask | None) -> float | None:
    if counted is not None and not flip_pixels(counted).any():
        return None
    return flip(image, truth, mask=counted)


def _lpips(weights: Path) -> Score:
    """LPIPS with weights from a file, of pictures all of whose pixels count.

    Its features look at so much of a picture that none of them is of the pixels that count alone.

    Raises:
        InputError: torch is missing, or the weights cannot be read.
    """
    if find_spec("torch") is None:
        raise InputError(
            "--lpips needs torch, which is not installed: pip install 'torch>=2.4,<2.14'"
        )
    from rift_cl.interop.lpips import Lpips

    lpips = Lpips(weights)
    return lambda image, truth, counted: lpips(image, truth) if counted is None else None
