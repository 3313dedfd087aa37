"""``rift eval``: how good a scene is, by pictures that somebody took of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional

from rift_cl.cl.discovery import open_device
from rift_cl.errors import InputError
from rift_cl.io.capture import View, camera_at, capture_name
from rift_cl.jobs.evaluate_report import eval_page
from rift_cl.jobs.fit import open_seen, split_views
from rift_cl.jobs.fit_pictures import CapturePictures
from rift_cl.jobs.fit_scores import ViewScore, score_record, score_views
from rift_cl.jobs.run_folder import RunFolder
from rift_cl.jobs.scene_input import SceneInput
from rift_cl.progress import Report
from rift_cl.splat.renderer import Renderer


@dataclass(frozen=True)
class EvalSettings(SceneInput):
    """Score a scene by captures of it.

    Example: rift eval fit capture/transforms_test.json --train capture --out scores
    """

    captures: Annotated[tuple[Path, ...], Positional] = ()
    """Captures to score: each a transforms.json, a folder with one, or a COLMAP model."""
    out: Path = Path("rift-eval")
    """Folder for report.html, config.json and metrics.json."""
    train: Path | None = None
    """The capture that was trained on: for the scores of its nearest pictures, and the angles."""
    hold_out: int = 0
    """Score every so many-th photograph of each capture, and take those of --train for unseen, as
    'rift fit' does; 0 scores all of them."""
    downscale: int | None = None
    """Whole factor by which photographs are made smaller; that of the fit, or 1, when not given."""
    overwrite: bool = False
    """Replace an earlier evaluation in the same folder."""
    dry_run: bool = False
    """Say what would be done, and stop."""


class Evaluation:
    """An evaluation that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the scene or a capture cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: EvalSettings) -> None:
        self.settings = settings
        if not settings.captures:
            raise InputError("there is no capture to score: name one or more after the scene")
        if settings.hold_out < 0:
            raise InputError(f"--hold-out is {settings.hold_out}, wanted 0 or more")
        self.scene = settings.open_scene()
        chosen = settings.downscale
        self.downscale = self.scene.downscale if chosen is None else chosen
        self.groups = {capture_name(path): self._scored(path) for path in settings.captures}
        if len(self.groups) < len(settings.captures):
            raise InputError("two captures have the same name: rename one folder")
        self.seen = self._seen()
        for view in [*self.seen, *(v for views in self.groups.values() for v in views)]:
            camera_at(view, self.downscale)
        self.device = open_device(settings.device)
        self.folder = RunFolder(settings.out, "eval", overwrite=settings.overwrite)
        self.metrics: dict[str, Any] = {}

    def _scored(self, path: Path) -> tuple[View, ...]:
        views = open_seen(path, pinhole=self.scene.pinhole).views
        every = self.settings.hold_out
        return views[::every] if every else views

    def _seen(self) -> tuple[View, ...]:
        """What was trained on; empty where nobody says."""
        if self.settings.train is None:
            return ()
        views = open_seen(self.settings.train, pinhole=self.scene.pinhole).views
        seen, _ = split_views(views, self.settings.hold_out, 0)
        files = {view.image.resolve() for view in seen}
        for name, scored in self.groups.items():
            both = next((view for view in scored if view.image.resolve() in files), None)
            if both is not None:
                raise InputError(
                    f"{both.name} of {name} is a photograph of --train, which is its own "
                    "nearest: leave --train out, or hold the scored ones out (--hold-out)"
                )
        return seen

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        scored = {f"score {name}": f"{len(views)} views" for name, views in self.groups.items()}
        trained = f"{len(self.seen)} views" if self.seen else "not named: no baselines"
        return {
            "scene": f"{self.scene.name}, {len(self.scene.splats)} splats",
            **scored,
            "trained on": trained,
            "downscale": str(self.downscale),
            "eps2d": f"{self.scene.drawing.eps2d:g}",
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report for each picture."""
        renderer = Renderer(self.scene.drawing, device=self.device)
        splats = self.scene.splats.upload(self.device)
        seen = self._pictures(self.seen) if self.seen else None
        self.folder.make()
        groups: dict[str, list[ViewScore]] = {}
        for name, views in self.groups.items():
            unseen = self._pictures(views, seen)
            groups[name] = []
            for score in score_views(renderer, splats, unseen, seen):
                groups[name].append(score)
                yield Report(len(groups[name]), len(views), f"views of {name}")
        self.metrics = {
            "splats": len(self.scene.splats),
            "eps2d": self.scene.drawing.eps2d,
            "downscale": self.downscale,
            **score_record(groups),
        }
        page = eval_page(self.scene.name, groups, self.metrics)
        self.folder.finish(self.settings, self.metrics, page, self.device)

    def _pictures(
        self, views: tuple[View, ...], like: CapturePictures | None = None
    ) -> CapturePictures:
        light = self.scene.light
        pictures = CapturePictures(
            self.device, views, downscale=self.downscale, light=light, like=like
        )
        if self.settings.background is not None:
            pictures.behind = self.scene.background
        return pictures
