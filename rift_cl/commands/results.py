"""What a command gives back in Python: figures, files, and what a notebook shows of them."""

from __future__ import annotations

import shutil
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.errors import RiftError
from rift_cl.geometry import Camera
from rift_cl.io import read_image, read_volume
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.report.notebook import card
from rift_cl.report.plot import jpeg
from rift_cl.report.shown import show
from rift_cl.sampling import Plan

Floats = NDArray[np.float32]
Shown = list[tuple[str, bytes]]
# Views that a notebook shows, and bytes of a volume that is read to be shown.
_FEW, _SHOWN_BYTES = 3, 1 << 29
# Percentiles of the values that are shown black and white, in percent.
_WINDOW = (0.5, 99.5)


@dataclass(frozen=True, eq=False)
class Result:
    """What a command made.

    A result stands for its folder wherever a path is wanted: ``rift.render(fitted)``.

    Args:
        folder: what was written, with report.html, config.json and metrics.json.
        settings: the command's settings, with the values that were decided.
        metrics: figures by name, as in metrics.json.
        notes: what was assumed or decided, a sentence each.
    """

    folder: Path
    settings: Any
    metrics: Mapping[str, Any]
    notes: tuple[str, ...]

    def __fspath__(self) -> str:
        """The folder."""
        return str(self.folder)

    def __repr__(self) -> str:
        facts = [
            f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
            for name, value in self._facts().items()
        ]
        return f"<{type(self).__name__} in {self.folder}: {', '.join(facts)}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return card(type(self).__name__, self._facts(), self._pictures())

    @property
    def report(self) -> Path:
        """The page that shows it all."""
        return self.folder / "report.html"

    def _facts(self) -> dict[str, Any]:
        """The figures that say most."""
        return {}

    def _pictures(self) -> Shown:
        """Captions and pictures that say most."""
        return []

    def remove_with_record(self) -> None:
        """Remove the folder once nobody holds this record any more, or when Python ends."""
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)


@dataclass(frozen=True, eq=False, repr=False)
class ReconstructedScan(Result):
    """A reconstruction.

    Args:
        path: the volume: a folder of slices, a file or a store, by the format asked for.
    """

    path: Path

    def read(self, *, budget: int | None = None) -> Floats:
        """The volume (z, y, x), attenuation per unit of length.

        Args:
            budget: bytes that it may take; 60 % of the free memory when not given.

        Raises:
            ResourceLimitError: it is larger than the budget.
        """
        return read_volume(self.path, budget=budget)

    def _facts(self) -> dict[str, Any]:
        names = ("center", "minimum", "maximum", "mean", "seconds")
        return {name: self.metrics[name] for name in names if name in self.metrics}

    def _pictures(self) -> Shown:
        return [("middle slice", (self.folder / "preview.png").read_bytes())]

    def _repr_html_(self) -> str:
        """What a notebook shows: the figures, and slices through the volume to go through."""
        try:
            volume = self.read(budget=_SHOWN_BYTES)
        except RiftError:
            # Large, or moved away: the preview tells of it.
            return super()._repr_html_()
        return card(type(self).__name__, self._facts(), more=show(volume)._repr_html_())


@dataclass(frozen=True, eq=False, repr=False)
class Scored(Result):
    """A scene that was scored by views it was not trained on.

    Args:
        scores: by the name of their group; each has the view's name, PSNR and SSIM, the image that
            was drawn and the truth.
    """

    scores: Mapping[str, Sequence[ViewScore]]

    def _facts(self) -> dict[str, Any]:
        return {
            f"{group}, {name}": value
            for group, values in self.metrics["scores"].items()
            for name, value in values.items()
            if name.startswith("fit_")
        }

    def _pictures(self) -> Shown:
        """The best, the middle and the worst view by PSNR, the truth before what was drawn."""
        views = [view for views in self.scores.values() for view in views]
        views.sort(key=lambda view: -view.values["fit_psnr"])
        shown = []
        for view in (views[place] for place in evenly(len(views), _FEW)):
            colors = view.truth.ndim == 3
            window = (0.0, 1.0) if colors else _window(view.truth)
            shown.append((f"{view.name}, truth", jpeg(view.truth, window=window)))
            caption = f"{view.name}, {view.values['fit_psnr']:.1f} dB"
            shown.append((caption, jpeg(view.image, window=window)))
        return shown


@dataclass(frozen=True, eq=False, repr=False)
class FittedScene(Scored):
    """Splats that were fitted, with the scores of the views held out.

    Args:
        losses: step and loss.
    """

    losses: Sequence[tuple[int, float]]

    @cached_property
    def scene(self) -> SplatScene:
        """The splats, in host memory; those of a scan in its units of length."""
        return SplatScene.load(self.folder / "scene.ply")

    def _facts(self) -> dict[str, Any]:
        return {"splats": self.metrics["splats"], **super()._facts()}


@dataclass(frozen=True, eq=False, repr=False)
class RenderedScene(Result):
    """Frames of a film, or views from given cameras.

    Args:
        cameras: of the frames.
        frames: their files.
        film: the film; None where frames differ in size or there is one alone.
        moving: a small animation as the content of a PNG or WebP file; None where there is no film.
    """

    cameras: tuple[Camera, ...]
    frames: tuple[Path, ...]
    film: Path | None
    moving: bytes | None

    def read(self, number: int) -> Floats:
        """A frame (height, width, 3) in display light, 0 to 1."""
        return read_image(self.frames[number])

    def _facts(self) -> dict[str, Any]:
        return {"frames": len(self.frames), "splats": self.metrics["splats"]}

    def _pictures(self) -> Shown:
        if self.moving is not None:
            return [("film", self.moving)]
        few = [self.frames[place] for place in evenly(len(self.frames), _FEW)]
        return [(frame.name, jpeg(read_image(frame))) for frame in few]


@dataclass(frozen=True, eq=False, repr=False)
class AnalyzedViews(Result):
    """What views sampled of a target.

    Args:
        tables: columns, rows and caption of each.
        added: cameras that would add most, the most useful first.
    """

    tables: Sequence[tuple[Sequence[str], Sequence[Sequence[Any]], str]]
    added: tuple[Camera, ...]

    def _facts(self) -> dict[str, Any]:
        metrics = self.metrics
        unknown = {} if metrics["unknown"] is None else {"unknown": metrics["unknown"]}
        return {"views": metrics["views"], **unknown, "views to add": len(self.added)}


@dataclass(frozen=True, eq=False, repr=False)
class PlannedViews(Result):
    """A plan that was written down.

    Args:
        plan: its cameras, what they are set to, and what they are worth.
    """

    plan: Plan

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The planned cameras, the most useful first, as in transforms.json."""
        return tuple(self.plan.cameras[place] for place in self.plan.order)

    def _facts(self) -> dict[str, Any]:
        return {"views": len(self.plan), "verdict": self.metrics["verdict"]}

    def _repr_html_(self) -> str:
        return self.plan._repr_html_()


@dataclass(frozen=True, eq=False)
class ScenePage:
    """A page on which a scene can be turned and walked through.

    Args:
        path: the page, a file of its own that any browser opens without a network.
    """

    path: Path

    def __fspath__(self) -> str:
        """The file."""
        return str(self.path)

    def _repr_html_(self) -> str:
        """The page itself, kept apart from the notebook's."""
        page = escape(self.path.read_text(encoding="utf-8"))
        return (
            f"<iframe srcdoc='{page}' title='Scene of splats: drag to turn, scroll to come nearer' "
            "sandbox='allow-scripts' style='width:100%;aspect-ratio:4/3;border:0'></iframe>"
        )


def _window(values: Floats) -> tuple[float, float]:
    low, high = (float(level) for level in np.percentile(values, _WINDOW))
    return low, high if high > low else low + 1
