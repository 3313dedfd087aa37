"""``rift plan``: camera poses for a target, compared with common arrangements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.commands.analyze.input import scaled_camera
from rift_cl.commands.inputs.view_set import ViewSet, place_of
from rift_cl.commands.pictures.views_table import csv_text, view_row
from rift_cl.commands.plan.input import plan_input
from rift_cl.commands.plan.report import plan_page
from rift_cl.commands.plan.scanner import (
    joined,
    missed_share,
    planes_sentence,
    vectors_of,
    vectors_text,
)
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.geometry import Vectors
from rift_cl.io.captures.capture import holds_capture
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import write_json, write_text
from rift_cl.progress import Report
from rift_cl.sampling.planning.candidates import most_candidates
from rift_cl.sampling.planning.design_space import DesignSpace
from rift_cl.sampling.planning.frequency_sets import for_planning
from rift_cl.sampling.planning.planner import plan
from rift_cl.sampling.planning.view_plan import Plan
from rift_cl.sampling.planning.wrong_prior import WrongPrior, if_wrong

_STEPS = 4


class Planning:
    """A plan that is asked for: what it wants is read, nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: a file cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: PlanSettings) -> None:
        settings.check()
        self.settings = settings
        self.given = plan_input(settings)
        # Cameras that cannot have the target in their picture are refused here, before any work.
        DesignSpace(self.given.target, self.given.constraints, self.given.types)
        # Millimetres per unit of transforms.json: a capture's own, so that its frames can be added.
        of_capture = settings.have is not None and holds_capture(settings.have)
        self.file_unit = settings.unit if of_capture else 1.0
        self.device = settings.open_device()
        self.folder = RunFolder.of(settings, "plan")
        self.metrics: dict[str, Any] = {}
        self.found: Plan | None = None
        self.verdict = ""
        self.wrong: tuple[WrongPrior, ...] = ()
        # The planned views of a cone-beam scanner, and the planes that its source never crosses.
        self.vectors: Vectors | None = None
        self.planes: dict[str, float] | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions, a sentence each."""
        return self.given.notes

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        given, settings = self.given, self.settings
        have = "" if given.have is None else f", in addition to {given.have.views} taken"
        low, high = settings.elevation
        first, last = settings.azimuth
        distance = settings.distance
        return {
            "views": f"{settings.views}{have}",
            "target": f"{given.target.diameter:.4g} mm about {place_of(given.target)}",
            "frequencies": f"{len(given.target.k)} up to {given.target.highest:.4g} cycles per mm",
            "memory": f"{format_bytes(self._memory())} at most, for the coverage of the candidates",
            "cameras": "; ".join(kind.name for kind in given.types),
            "elevation": f"{low:g} to {high:g} degrees",
            "azimuth": f"{first:g} to {last:g} degrees",
            "distance": "as near as it fits" if distance is None else "{:g} to {:g} mm".format(
                *distance),
            "path": settings.path,
            "criterion": settings.criterion,
            "assumed": " ".join(given.notes) or "nothing",
            "device": self.device.name,
        }  # fmt: skip

    def _memory(self) -> int:
        count = most_candidates(self.settings.views)
        target = for_planning(self.given.target, count)
        return 8 * count * len(target.points) * len(target.k)

    def run(self) -> Iterator[Report]:
        """Do it: the plan, what it is worth, the pictures, the files."""
        settings, given = self.settings, self.given
        yield Report(0, _STEPS, "steps")
        found = plan(
            given.target,
            settings.views,
            given.constraints,
            given.types,
            fixed=() if given.have is None else given.have.cameras,
            seed=settings.seed,
            kind=settings.criterion,
        )
        self.found = found
        yield Report(1, _STEPS, "steps", {"criterion": found.elsewhere})
        self.wrong = if_wrong(found)
        self.verdict = " ".join([found.verdict(), *(entry.sentence for entry in self.wrong)])
        self._count_planes(found)
        diminishing_returns = found.diminishing_returns()
        yield Report(2, _STEPS, "steps", {"criterion": found.elsewhere})
        sampled = self._sampled(found)
        self.metrics = self._figures(found)
        page = plan_page(given, found, diminishing_returns, sampled, self.metrics, self.device)
        yield Report(3, _STEPS, "steps", {"criterion": found.elsewhere})
        self._write(found)
        self.folder.finish(given.decided, self.metrics, page, self.device, asked=settings)
        yield Report(_STEPS, _STEPS, "steps", {"criterion": found.elsewhere})

    def _count_planes(self, found: Plan) -> None:
        """Of a cone-beam scanner, say what the planned views change of Tuy's condition."""
        have = self.given.have
        if have is None or have.orbit is None:
            return
        self.vectors = vectors_of(tuple(found.cameras[n] for n in found.order), have.orbit)
        before = missed_share(have.orbit, have)
        after = missed_share(joined(have.orbit, self.vectors), have)
        self.planes = {"before": before, "after": after}
        self.verdict += " " + planes_sentence(before, after)

    def _sampled(self, found: Plan) -> ViewSet:
        """All views, those that were there already first."""
        given = self.given
        return ViewSet(
            name="plan",
            target=given.target,
            up=np.array(given.constraints.up),
            unit="mm",
            cameras=(*found.fixed, *found.cameras),
            weights=np.concatenate([found.fixed_weights, found.weights]),
        )

    def _figures(self, found: Plan) -> dict[str, Any]:
        given, diminishing_returns = self.given, found.diminishing_returns()
        return {
            "views": len(found),
            "wanted": self.settings.views,
            "taken_before": len(found.fixed),
            "criterion": self.settings.criterion,
            "value": found.elsewhere,
            "planned_with": {"value": found.merit, "bound": found.bound},
            "mode": given.target.mode,
            "cost": found.cost,
            "baselines": {name: entry.elsewhere for name, entry in found.baselines.items()},
            "verdict": self.verdict,
            "if_prior_is_wrong": [entry._asdict() for entry in self.wrong],
            "diminishing_returns": diminishing_returns.views,
            "values": diminishing_returns.merits,
            "target": {"center": given.target.center, "diameter": given.target.diameter},
            **({} if self.planes is None else {"planes_never_crossed": self.planes}),
            "assumed": list(given.notes),
        }

    def _write(self, found: Plan) -> None:
        out, order = self.settings.out, found.order
        self.folder.make()
        self.folder.mark()
        self.folder.drop("vectors.txt")
        names = [f"images/{number:04d}.jpg" for number in range(len(found))]
        cameras = [found.cameras[place] for place in order]
        types = [found.types[place] for place in order]
        fields = [
            {
                "camera": kind.name,
                "focal_length": kind.focal_length,
                "f_number": kind.f_number,
                "exposure": kind.exposure,
            }
            for kind in types
        ]
        own = [scaled_camera(camera, 1 / self.file_unit) for camera in cameras]
        record = {"millimetres_per_unit": self.file_unit, **transforms_of(own, names, fields)}
        write_json(out / "transforms.json", record)
        center, up = self.given.target.center, np.array(self.given.constraints.up)
        rows = [
            view_row(
                name,
                camera,
                center,
                up,
                (kind.name, kind.focal_length, kind.f_number, kind.exposure),
            )
            for name, camera, kind in zip(names, cameras, types, strict=True)
        ]
        write_text(out / "views.csv", csv_text(rows, "mm"))
        if self.vectors is not None:
            write_text(out / "vectors.txt", vectors_text(self.vectors))
