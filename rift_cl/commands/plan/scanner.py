"""Plans for a scanner: what it has scanned stands for its source, its detector and its orbit.

A view of a fan or a cone is a picture of a pinhole camera, so that further places of the source are
planned as those of cameras are: as far from the target as before, with the detector held to the
ray through the target as it was. Azimuths are places on the orbit, elevations are tilts of the
object (or of the gantry) against it.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from rift_cl.commands.analyze.input import in_millimetres, open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.analyze.suggestions import camera_type_of, usual_distance
from rift_cl.commands.inputs.scan_input import ScanArrays
from rift_cl.commands.inputs.view_set import Floats, ViewSet
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.errors import InputError
from rift_cl.geometry import Camera, Cone, Vectors
from rift_cl.geometry.pose import look_at
from rift_cl.geometry.seen_grid import seen_grid
from rift_cl.io.captures.camera_file import CameraChoice
from rift_cl.sampling.criteria.tuy import missed_planes
from rift_cl.sampling.targets.prior import directions_for

# Share of the target's outline on the detector: it stays as large as it is, whatever the target.
COVER = 0.05
# Tangent of the angle to z below which a view is along it.
_ALONG = 1e-6
# Points of the target at which planes are counted, and how far out they lie, as a share of the
# radius.
_POINTS, _OUT = 60, 0.7


def scanned(settings: PlanSettings, path: Path) -> ViewSet:
    """The views of a fan-beam or cone-beam scan, in millimetres.

    Raises:
        RiftError: the file cannot be read, or its rays are parallel; or an option does not apply.
    """
    if settings.mode == "surface":
        raise InputError(f"--mode surface applies to photographs, --have {path} is a scan")
    for name in ("center", "lens", "camera"):
        if getattr(settings, name):
            raise InputError(f"--{name} applies to photographs, --have {path} is a scan")
    if COVER < settings.cover < 1:
        raise InputError(
            f"--cover is {settings.cover:g}, but --have {path} is a scan: wanted {COVER:g} at most"
        )
    diameter = None if settings.diameter is None else settings.diameter / settings.unit
    read = {field.name: getattr(settings, field.name) for field in fields(ScanArrays)}
    asked = AnalyzeSettings(source=path, diameter=diameter, device=settings.device, **read)
    asked.check()
    sampled = open_sampled(asked)
    if sampled.scan is not None:
        raise InputError(
            f"--have {path} is a scan with parallel rays, whose views have no place to plan: "
            "'rift analyze' names the angles that its largest gaps want"
        )
    notes = [*sampled.notes]
    if sampled.unit != "mm" and settings.unit == 1:
        notes.append(f"One {sampled.unit} of the scan is taken to be 1 mm (--unit).")
    orbit = None if sampled.orbit is None else sampled.orbit.scaled(settings.unit)
    return replace(in_millimetres(sampled, settings.unit), orbit=orbit, notes=tuple(notes))


def scanner_choice(have: ViewSet) -> CameraChoice:
    """The scanner's detector and its distance from the source, as a camera."""
    middle = have.cameras[len(have.cameras) // 2]
    return CameraChoice(replace(camera_type_of(middle), name="the scanner"))


def source_distance(have: ViewSet) -> tuple[float, float]:
    """Nearest and farthest distance of the source from the target: the one that it has."""
    distance = usual_distance(have)
    return distance, distance


def elevations(have: ViewSet, asked: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest elevation in degrees; a fan stays in its plane."""
    return (0.0, 0.0) if have.is_flat else asked


def vectors_of(cameras: tuple[Camera, ...], orbit: Cone | Vectors) -> Vectors:
    """Planned views as places of the source and of the scanner's detector.

    Args:
        cameras: the views.
        orbit: the scan that was taken, whose detector it is.
    """
    taken = _vectors(orbit)
    held = _detector(taken, _looked_at(taken, orbit))
    source = np.stack([camera.center for camera in cameras])
    turns = np.stack([camera.view[:3, :3] for camera in cameras])
    middle, across, down = (vector @ turns for vector in held)
    return Vectors(source, source + middle, across, down, orbit.rows, orbit.bins)


def _detector(taken: Vectors, aims: Floats) -> Floats:
    """Where a scanner holds its detector, (3, 3): to its middle, from bin to bin, from row to row.

    The medians over the views, in the coordinates (right, down, ahead) of an upright camera at the
    source: a detector that stands aside, or is rolled in its plane, does so in all of them.

    Args:
        taken: the views.
        aims: what these cameras look at, (views, 3).
    """
    vectors = np.stack([taken.middle - taken.source, taken.across, taken.down], axis=1)
    ahead = aims - taken.source
    along_z = np.hypot(ahead[:, 0], ahead[:, 1]) < _ALONG * np.abs(ahead[:, 2])
    turns = np.stack(
        [
            look_at(source, aim, (0, 1, 0) if along else (0, 0, 1))[:3, :3]
            for source, aim, along in zip(taken.source, aims, along_z, strict=True)
        ]
    )
    return np.asarray(np.median(vectors @ turns.transpose(0, 2, 1), axis=0))


def _looked_at(taken: Vectors, orbit: Cone | Vectors) -> Floats:
    """What each view looks at, (views, 3): the middle of the volume; of a helix, as it rises."""
    aims = np.zeros_like(taken.source)
    aims[:, 2] = seen_grid(orbit).center[0]
    if isinstance(orbit, Cone):
        aims[:, 2] += orbit.heights - (orbit.heights.min() + orbit.heights.max()) / 2
    return aims


def vectors_text(views: Vectors) -> str:
    """The views in ASTRA's order, a line each, as ``--geometry`` reads them."""
    numbers = np.concatenate([views.source, views.middle, views.across, views.down], axis=1)
    return "".join(" ".join(f"{x + 0.0:.9g}" for x in row) + "\n" for row in numbers)


def joined(orbit: Cone | Vectors, more: Vectors) -> Vectors:
    """The views that were taken, and those that are planned."""
    taken = _vectors(orbit)
    source, middle, across, down = (
        np.concatenate([getattr(taken, name), getattr(more, name)])
        for name in ("source", "middle", "across", "down")
    )
    return Vectors(source, middle, across, down, taken.rows, taken.bins)


def _vectors(orbit: Cone | Vectors) -> Vectors:
    return orbit.vectors() if isinstance(orbit, Cone) else orbit


def missed_share(orbit: Cone | Vectors, have: ViewSet) -> float:
    """The mean share of planes through points of the target that the source never crossed."""
    ways: Floats = directions_for(3, _POINTS)
    center, out = have.target.center, _OUT * have.target.diameter / 2
    points = np.concatenate([center[None], center + out * ways, center - out * ways])
    return float(np.mean(missed_planes(orbit, points)))


def planes_sentence(before: float, after: float) -> str:
    """What further views change of Tuy's condition, for a reader."""
    if not before:
        return "The source's path crosses every plane through the target already."
    return (
        f"The source never crosses {_percent(before)} of the planes through the target, and "
        f"{_percent(after)} with the planned views, if it goes to them on one path."
    )


def _percent(share: float) -> str:
    return f"{share:.1%}" if share == 0 or share >= 1e-3 else f"{100 * share:.2g}%"
