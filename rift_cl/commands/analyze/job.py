"""``rift analyze``: coverage, missing directions, resolution limits, and views to add."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.commands.analyze.facts import Findings, Table, missing, resolution, unknown_share
from rift_cl.commands.analyze.input import open_views
from rift_cl.commands.analyze.report import analysis_page
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.analyze.suggestions import (
    angles_to_add,
    cameras_to_add,
    kept_near,
    usual_distance,
)
from rift_cl.commands.analyze.surface import surface_missing, surface_resolution
from rift_cl.commands.inputs.surfaces import ASTRAY, sides_of, surface_of
from rift_cl.commands.inputs.view_set import Floats, ViewSet, place_of
from rift_cl.commands.pictures.coverage_pictures import MAP_BYTES
from rift_cl.commands.pictures.views_table import csv_text, view_row
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io.output import write_text
from rift_cl.progress import Report
from rift_cl.sampling.criteria.surface import surface_criterion

_STEPS = 4
# Bytes of a view of a point: its direction, weight, pixel, cut-off and blur.
_LOOK = 7 * 8


class Analysis:
    """An analysis that is planned: the views are read, nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the file cannot be read, a setting makes no sense, or no view sees the target.
    """

    def __init__(self, settings: AnalyzeSettings) -> None:
        settings.check()
        self.settings = settings
        views, self.decided = open_views(settings)
        self.sampled, self.points = _observed(views)
        self.device = settings.open_device()
        self.folder = RunFolder.of(settings, "analyze")
        self.metrics: dict[str, Any] = {}
        self.tables: list[Table] = []
        # Conclusions, for the console as for the page.
        self.sentences: list[str] = []
        self.added: tuple[Camera, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions, a sentence each."""
        return self.sampled.notes

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        sampled = self.sampled
        target, unit = sampled.target, sampled.unit
        return {
            "views": f"{sampled.views} of {sampled.name}",
            "target": f"{target.diameter:.4g} {sampled.units} about {place_of(target)}",
            "points": "; ".join(self.points),
            "frequencies": f"{len(target.k)} up to {target.highest:.4g} cycles per {unit}",
            "memory": f"{format_bytes(_LOOK * sampled.views * len(self.points))} of views, "
            f"{format_bytes(MAP_BYTES)} a map",
            "views to suggest": str(self.settings.add),
            "assumed": " ".join(sampled.notes) or "nothing",
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Do it: what is missing, what limits, what to add, the pictures."""
        sampled = self.sampled
        yield Report(0, _STEPS, "steps")
        findings = self._found()
        yield Report(1, _STEPS, "steps")
        self.added, more = self._added()
        yield Report(2, _STEPS, "steps")
        findings.append(more)
        self.tables = [table for found in findings for table in found.tables]
        self.sentences = [text for found in findings for text in found.sentences]
        self.metrics = {
            "source": str(self.settings.source),
            "views": sampled.views,
            "views_of_center": int((sampled.observations().weight[:, 0] > 0).sum()),
            "target": {"center": sampled.target.center, "diameter": sampled.target.diameter},
            "unit": sampled.unit,
            "unknown": self._unknown(sampled),
            **{key: value for found in findings for key, value in found.figures.items()},
            "assumed": list(sampled.notes),
        }
        page = analysis_page(sampled, self.points, findings, self.metrics, self.added, self.device)
        yield Report(3, _STEPS, "steps")
        self._write()
        self.folder.finish(self.decided, self.metrics, page, self.device, asked=self.settings)
        yield Report(_STEPS, _STEPS, "steps")

    def _found(self) -> list[Findings]:
        """What is missing, and what limits detail."""
        sampled, names = self.sampled, tuple(self.points)
        if sampled.opaque:
            far = usual_distance(sampled)
            return [surface_missing(sampled, far), surface_resolution(sampled, names)]
        return [missing(sampled), resolution(sampled, names)]

    def _added(self) -> tuple[tuple[Camera, ...], Findings]:
        """Cameras to add, and what is to be said of them or of angles to add."""
        sampled, count = self.sampled, self.settings.add
        if sampled.is_flat or sampled.orbit is not None:
            return (), self._angles()
        if not count:
            return (), Findings({"add": []}, (), ())
        if any(camera.model != "pinhole" for camera in sampled.cameras):
            text = "No views are suggested: that needs pinhole cameras."
            return (), Findings({"add": []}, (), (text,))
        try:
            cameras = cameras_to_add(sampled, count)
        except InputError as error:
            return (), Findings({"add": []}, (), (f"No views are suggested: {error}.",))
        return cameras, self._worth(cameras)

    def _angles(self) -> Findings:
        """The gaps of a scan."""
        # A line of sight turns as the angle of its scan does.
        x, y, _ = self.sampled.directions().T
        gap, angles = angles_to_add(np.arctan2(-x, y), self.settings.add)
        shown = ", ".join(f"{angle:.4g}" for angle in angles)
        text = f"The largest gap between directions is {gap:.4g} degrees."
        more = f" To add: {shown} degrees." if angles else ""
        return Findings({"largest_gap_degrees": gap, "add": angles}, (), (text + more,))

    def _worth(self, cameras: tuple[Camera, ...]) -> Findings:
        """Positions of cameras to add, and their gain."""
        sampled = self.sampled
        rows = [(row[0], *(round(float(n), 6) for n in row[1:4])) for row in self._rows(cameras)]
        columns = ("add", "azimuth, °", "elevation, °", f"distance, {sampled.units}")
        more = sampled.with_cameras(cameras)
        start = f"With {len(cameras)} more such views"
        if sampled.opaque:
            far = usual_distance(sampled)
            gaps = [sides_of(one, far).gap for one in (more, sampled)]
            sentences = [
                f"{start} the side farthest from all views would be {gaps[0]:.3g} degrees from the "
                f"nearest, instead of {gaps[1]:.3g}."
            ]
        else:
            sentences = [
                f"{start} the posterior variance would be {self._unknown(more):.3%} of the prior, "
                f"instead of {self._unknown(sampled):.3%}."
            ]
        if kept_near(sampled):
            sentences.append(
                f"None is suggested more than about {ASTRAY:.0f} degrees from the views at hand, "
                "since nothing tells what stands there: for views on all sides, run 'rift fit' and "
                "analyze its folder."
            )
        names = ("azimuth", "elevation", "distance")
        figures = {
            "add": [dict(zip(names, row[1:], strict=True)) for row in rows],
            "unknown_with_added": self._unknown(more),
        }
        caption = "The most informative first, each given those before it."
        return Findings(figures, ((columns, rows, caption),), tuple(sentences))

    @staticmethod
    def _unknown(sampled: ViewSet) -> float:
        """What the views leave unknown: of the target's power, or of a surface."""
        if not sampled.opaque:
            return unknown_share(sampled)
        target = surface_of(sampled, usual_distance(sampled))
        return surface_criterion(sampled.observations(target.points), target)[0]

    def _rows(self, cameras: tuple[Camera, ...]) -> list[tuple[Any, ...]]:
        center, up = self.sampled.target.center, self.sampled.up
        return [view_row(f"{k + 1}", c, center, up) for k, c in enumerate(cameras)]

    def _write(self) -> None:
        self.folder.make()
        self.folder.mark()
        self.folder.drop("views.csv")
        if self.added:
            text = csv_text(self._rows(self.added), self.sampled.units)
            write_text(self.settings.out / "views.csv", text)


def _observed(sampled: ViewSet) -> tuple[ViewSet, dict[str, Floats]]:
    """The views with those points of the target that one of them sees, and the points' names.

    Raises:
        InputError: none sees its middle.
    """
    target = sampled.target
    sampled.observations(target.center[None]).check_seen()
    points = sampled.named_points
    weight = sampled.observations(np.array(list(points.values()))).weight
    kept = {name: at for (name, at), w in zip(points.items(), weight.T, strict=True) if w.any()}
    notes = sampled.notes
    if len(kept) < len(points):
        lost = ", ".join(sorted(set(points) - set(kept)))
        notes = (
            *notes,
            f"No view sees the point {lost} by 0.7 of the target's radius: it is left out.",
        )
    found = dataclasses.replace(target, points=np.array(list(kept.values())))
    return dataclasses.replace(sampled, target=found, notes=notes), kept
