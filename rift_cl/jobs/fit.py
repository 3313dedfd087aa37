"""``rift fit``: posed photographs become splats, and a report that says how good they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tyro.conf import Positional

from rift_cl.cl.discovery import open_device
from rift_cl.errors import InputError
from rift_cl.io.capture import View, camera_at, open_capture
from rift_cl.io.splat_scene import SplatScene
from rift_cl.jobs.fit_pictures import CapturePictures
from rift_cl.jobs.fit_report import fit_page
from rift_cl.jobs.fit_scores import ViewScore, mean_scores, score_views
from rift_cl.jobs.run_folder import RunFolder
from rift_cl.progress import Report
from rift_cl.splat.bands import FrameMemory
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start import hull_points, random_points, start_splats
from rift_cl.train.trainer import Trainer

# A fit begins with no more random splats than this share of all it may have.
_FIRST_SHARE = 0.5
# Photographs that carve the visual hull.
_HULL_VIEWS = 50


@dataclass(frozen=True)
class FitSettings:
    """Fit splats to posed photographs.

    Example: rift fit capture/transforms.json --out fit --steps 3000 --splats 20000
    """

    capture: Annotated[Path, Positional]
    """A transforms.json, a folder with one, or a COLMAP model."""
    out: Path = Path("rift-fit")
    """Folder for scene.ply, report.html, config.json and metrics.json."""
    steps: int = 3000
    """Pictures that are looked at, one after the other."""
    splats: int = 20_000
    """Most splats."""
    seed: int = 0
    """Of everything that is random: the same seed gives the same splats, bit by bit."""
    sh_degree: int = 3
    """Degree of the colours' spherical harmonics, 0 to 4."""
    eps2d: float = 0.1
    """Variance that splats gain on the screen, in square pixels; 0.3 is usual and blurs small
    pictures, 0.05 to 0.1 suits cameras that all keep one distance."""
    downscale: int = 1
    """Whole factor by which photographs are made smaller."""
    hold_out: int = 8
    """Every so many-th photograph is not trained on but scored; 0 for none."""
    views: int = 0
    """Train on so many photographs, evenly spaced; 0 for all."""
    test: tuple[Path, ...] = ()
    """More captures to score, never trained on."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
    overwrite: bool = False
    """Replace an earlier fit in the same folder."""
    dry_run: bool = False
    """Say what would be done, and stop."""


class Fit:
    """A fit that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the capture cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: FitSettings) -> None:
        self.settings = settings
        for name, least in (("downscale", 1), ("hold_out", 0), ("views", 0)):
            if getattr(settings, name) < least:
                option = name.replace("_", "-")
                raise InputError(f"--{option} is {getattr(settings, name)}, wanted {least} or more")
        self.training = TrainSettings(
            steps=settings.steps,
            seed=settings.seed,
            splats=settings.splats,
            sh_degree=settings.sh_degree,
        )
        self.drawing = SplatSettings(eps2d=settings.eps2d)
        self.capture = open_capture(settings.capture)
        self.seen, self.unseen = split_views(self.capture.views, settings.hold_out, settings.views)
        self.tests = {_name_of(path): open_capture(path) for path in settings.test}
        if len(self.tests) < len(settings.test):
            raise InputError("--test names two captures of the same name: rename one folder")
        self.device = open_device(settings.device)
        self.folder = RunFolder(settings.out, "fit", overwrite=settings.overwrite)
        self.losses: list[tuple[int, float]] = []
        self.metrics: dict[str, Any] = {}

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        cameras = [camera_at(view, self.settings.downscale) for view in self.seen]
        largest = max(camera.height * camera.width for camera in cameras)
        parameters = 11 + 3 * (self.settings.sh_degree + 1) ** 2
        memory = FrameMemory(self.settings.splats, parameters, largest, 3, gradient=True)
        # Besides what a frame takes there are Adam's two moments of every parameter.
        need = memory.fixed + 8 * parameters * self.settings.splats
        return {
            "capture": str(self.capture.path),
            "trained on": f"{len(self.seen)} photographs",
            "held out": f"{len(self.unseen)} photographs",
            "largest photograph": f"{largest} pixels",
            "splats": f"at most {self.settings.splats}, harmonics of degree "
            f"{self.settings.sh_degree}",
            "device memory": f"{need / 2**20:.0f} MiB and the tile lists",
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report now and then."""
        settings = self.settings
        pictures = self._pictures(self.seen)
        trainer = Trainer(pictures, self._start(pictures), self.training, self.drawing)
        self.folder.make()
        for report in trainer.run():
            self.losses.append((report.done, report.values["loss"]))
            yield report
        splats = trainer.parameters.drawn
        SplatScene.of(splats, self.device).save(settings.out / "scene.ply")
        groups: dict[str, list[ViewScore]] = {}
        for name, views in self._scored().items():
            unseen = self._pictures(views, pictures)
            groups[name] = []
            for score in score_views(trainer.renderer, splats, unseen, pictures):
                groups[name].append(score)
                yield Report(len(groups[name]), len(views), f"views of {name}")
        self.metrics = self._figures(groups, len(splats))
        page = fit_page(self.capture.path.name, groups, self.losses, self.metrics)
        self.folder.finish(settings, self.metrics, page, self.device)

    def _pictures(
        self, views: tuple[View, ...], like: CapturePictures | None = None
    ) -> CapturePictures:
        settings = self.settings
        return CapturePictures(
            self.device,
            views,
            downscale=settings.downscale,
            seed=settings.seed,
            like=like,
        )

    def _start(self, pictures: CapturePictures) -> Parameters:
        """Splats at the capture's points, or at random where the cameras look."""
        settings, points, colors = self.settings, self.capture.points, self.capture.point_colors
        if points is None or len(points) == 0:
            points, colors = self._guess(pictures), None
        elif len(points) > settings.splats:
            random = np.random.default_rng((settings.seed, 0x901))
            kept = np.sort(random.choice(len(points), settings.splats, replace=False))
            points, colors = points[kept], None if colors is None else colors[kept]
        raw = start_splats(
            np.asarray(points, float),
            None if colors is None else np.asarray(colors, float),
            seed=settings.seed,
        )
        return Parameters.of(self.device, raw)

    def _guess(self, pictures: CapturePictures) -> Any:
        """Points in the visual hull, or where the cameras look if there is no background."""
        count, seed = self.settings.splats, self.settings.seed
        few = np.unique(np.linspace(0, len(self.seen) - 1, _HULL_VIEWS).round().astype(int))
        fronts = [pictures.foreground(number) for number in few.tolist()]
        masks = [front for front in fronts if front is not None]
        if len(masks) == len(few):
            cameras = [pictures.cameras[number] for number in few.tolist()]
            points = hull_points(cameras, masks, count, seed)
            if points is not None:
                return points
        return random_points(pictures.cameras, max(1, int(count * _FIRST_SHARE)), seed)

    def _scored(self) -> dict[str, tuple[View, ...]]:
        """The pictures that are scored, by the name of their group."""
        groups = {"held out": self.unseen} if self.unseen else {}
        return groups | {name: capture.views for name, capture in self.tests.items()}

    def _figures(self, groups: dict[str, list[ViewScore]], splats: int) -> dict[str, Any]:
        return {
            "splats": splats,
            "loss": self.losses[-1][1],
            "scores": {name: mean_scores(scores) for name, scores in groups.items()},
            "views": {
                name: [{"name": s.name, "angle": s.angle, **s.values} for s in scores]
                for name, scores in groups.items()
            },
        }


def _name_of(path: Path) -> str:
    """How a capture is called: its folder, or a file that is not named transforms."""
    return path.parent.name if path.name == "transforms.json" else path.stem


def split_views(
    views: tuple[View, ...], hold_out: int, count: int
) -> tuple[tuple[View, ...], tuple[View, ...]]:
    """The photographs to train on, and those that are held out: every ``hold_out``-th.

    Args:
        views: all of them, in the capture's order.
        hold_out: 0 for none.
        count: train on so many, evenly spaced among the rest; 0 for all.

    Raises:
        InputError: nothing is left to train on, or there are fewer than ``count``.
    """
    seen = tuple(v for k, v in enumerate(views) if not hold_out or k % hold_out)
    unseen = tuple(v for k, v in enumerate(views) if hold_out and k % hold_out == 0)
    if not seen:
        raise InputError(f"--hold-out {hold_out} leaves no photograph to train on")
    if count > len(seen):
        raise InputError(f"--views is {count}, there are {len(seen)} photographs to train on")
    if count:
        seen = tuple(seen[int(k)] for k in np.arange(count) * len(seen) / count)
    return seen, unseen
