"""The input of a plan: the target, the cameras to choose from, their constraints in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.inputs.surfaces import SURFACE, hidden_places, sides_above, surface_of
from rift_cl.commands.inputs.view_set import Floats, ViewSet
from rift_cl.commands.options import absolute_paths
from rift_cl.commands.plan.scanner import (
    COVER,
    elevations,
    scanned,
    scanner_choice,
    source_distance,
)
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.errors import InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.io.captures.camera_file import CameraChoice, read_cameras, with_lens
from rift_cl.io.captures.capture import holds_capture
from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.io.volumes import read_volume
from rift_cl.sampling.planning.constraints import Budget, Constraints, Ranges
from rift_cl.sampling.planning.design_space import DISTANCE, DesignSpace
from rift_cl.sampling.planning.keep_out import Box, Cone, KeepOut, Sphere
from rift_cl.sampling.planning.paths import Free, Ring, Spline, TiltedRings
from rift_cl.sampling.planning.paths import Path as Way
from rift_cl.sampling.targets.directional_prior import Trusted
from rift_cl.sampling.targets.pilot import Pilot
from rift_cl.sampling.targets.prior import PowerLaw, Prior
from rift_cl.sampling.targets.target import Target

Samples = NDArray[np.float32]
DIAMETER = 100.0
# What most people have: 24 megapixels of 3.9 micrometres, 50 mm, closed far enough for depth.
USUAL = CameraChoice(CameraType("24 MP, 50 mm, f/11", 50.0, 11.0, 3.9e-3, (4000, 6000)))


@dataclass(frozen=True, eq=False)
class PlanInput:
    """What a plan is made of; lengths in millimetres.

    Args:
        target: what is looked at.
        constraints: what the views have to keep to.
        choices: cameras that may be used.
        have: views that are taken already, or None.
        notes: what had to be assumed, a sentence each.
        decided: the settings with the values that were decided.
    """

    target: Target
    constraints: Constraints
    choices: tuple[CameraChoice, ...]
    have: ViewSet | None
    notes: tuple[str, ...]
    decided: PlanSettings

    @property
    def types(self) -> tuple[CameraType, ...]:
        """The cameras that may be used."""
        return tuple(choice.kind for choice in self.choices)


def plan_input(settings: PlanSettings) -> PlanInput:
    """Read what the settings name, and fill in what they leave out.

    Raises:
        RiftError: a file cannot be read, or constraints or a camera make no sense.
    """
    notes: list[str] = []
    have = None if settings.have is None else _have(settings, settings.have)
    scanner = settings.have is not None and not holds_capture(settings.have)
    if have is not None and scanner:
        settings = replace(
            settings,
            mode="volume",
            distance=settings.distance or source_distance(have),
            elevation=elevations(have, settings.elevation),
            cover=min(settings.cover, COVER),
        )
    volume = None if settings.pilot is None else read_volume(settings.pilot)
    target = _target(settings, have, volume, notes)
    choices = (scanner_choice(have),) if have and scanner else _choices(settings, notes)
    constraints = _constraints(settings, choices, have)
    if have is not None and have.space is not None:
        constraints, target = _in_sight(have, target, constraints, choices)
    decided = _decided(settings, target, volume)
    return PlanInput(target, constraints, choices, have, tuple(notes), decided)


def _decided(settings: PlanSettings, target: Target, volume: Samples | None) -> PlanSettings:
    """The settings with a value for everything that was left open.

    Where the target is that of ``--have``, centre and diameter are left to it: they are found in
    its units.
    """
    decided: dict[str, Any] = {"mode": target.mode, "band": target.highest}
    if settings.have is None:
        x, y, z = target.center.tolist()
        decided |= {"center": (x, y, z), "diameter": target.diameter}
    if volume is not None:
        decided["pilot_spacing"] = _spacing(settings, target.diameter, volume)
    return replace(absolute_paths(settings), **decided)


def _spacing(settings: PlanSettings, diameter: float, volume: Samples) -> float:
    """Millimetres between the samples of the pilot."""
    return settings.pilot_spacing or diameter / max(volume.shape)


def _in_sight(
    have: ViewSet, target: Target, constraints: Constraints, choices: tuple[CameraChoice, ...]
) -> tuple[Constraints, Target]:
    """The constraints, and the sides of the target, without what views show to be in the way."""
    design = DesignSpace(target, constraints, tuple(choice.kind for choice in choices))
    near, far = design.limits[:, DISTANCE, 0].min(), design.limits[:, DISTANCE, 1].max()
    shut = hidden_places(have, float(near), float(far))
    open_sides = surface_of(have, float(math.sqrt(near * far)))
    target = replace(target, points=open_sides.points, normals=open_sides.normals)
    if shut is None:
        return constraints, target
    return replace(constraints, keepouts=(*constraints.keepouts, shut)), target


def _have(settings: PlanSettings, path: Path) -> ViewSet:
    if not holds_capture(path):
        return scanned(settings, path)
    asked = AnalyzeSettings(
        source=path, center=_in_units(settings), diameter=_over(settings.diameter, settings.unit),
        unit=settings.unit, mode="surface" if settings.opaque else "volume", device=settings.device,
    )  # fmt: skip
    asked.check()
    have = open_sampled(asked)
    if settings.unit != 1:
        return have
    away = [np.linalg.norm(camera.center - have.target.center) for camera in have.cameras]
    note = (
        f"One unit of {path} is taken to be 1 mm (--unit): its cameras are {min(away):.3g} to "
        f"{max(away):.3g} mm away from the target."
    )
    return replace(have, notes=(*have.notes, note))


def _in_units(settings: PlanSettings) -> tuple[float, float, float] | None:
    if settings.center is None:
        return None
    x, y, z = (value / settings.unit for value in settings.center)
    return x, y, z


def _over(length: float | None, unit: float) -> float | None:
    return None if length is None else length / unit


def _target(
    settings: PlanSettings, have: ViewSet | None, volume: Samples | None, notes: list[str]
) -> Target:
    if have is not None:
        center, diameter = have.target.center, have.target.diameter
        notes.extend(have.notes)
    else:
        center = np.array(settings.center or (0.0, 0.0, 0.0))
        diameter = settings.diameter or DIAMETER
        if settings.diameter is None:
            notes.append(f"The target's diameter is taken to be {DIAMETER:g} mm (--diameter).")
    prior = _prior(settings, diameter, volume, notes)
    points, normals = center[None], None
    if settings.opaque:
        up = np.array([0.0, 0, 1]) if have is None else have.up
        normals = sides_above(up, math.sin(math.radians(settings.elevation[0])), 2 * SURFACE)
        points = center + diameter / 2 * normals
        if have is None:
            notes.append(
                "The target is taken to be opaque: a sphere stands for its surface, without the "
                "sides that face below all cameras, and nothing else occludes it (--mode volume is "
                "for X-rays)."
            )
        elif have.space is None:
            notes.append(
                "Occlusion is not known: name regions to keep out of (--keep-out), or give the "
                "folder of a fit."
            )
    elif settings.have is None or holds_capture(settings.have):
        notes.append(
            "The target is taken to be transparent, so that opposite views are equivalent and one "
            "side may stay without views; for an opaque one use --mode surface."
        )
    given: dict[str, Any] = {
        "points": points,
        "normals": normals,
        "mode": "surface" if settings.opaque else "volume",
        "prior": prior,
        "snr": settings.snr,
        "band": settings.band,
    }
    if have is not None and have.is_flat:
        return Target.flat(diameter, center, **given)
    return Target(center=center, diameter=diameter, **given)


def _prior(
    settings: PlanSettings, diameter: float, volume: Samples | None, notes: list[str]
) -> Prior:
    if volume is None:
        notes.append(
            "The target's power spectrum is taken to be isotropic and to fall as 1/k^2 (--pilot)."
        )
        return PowerLaw(2.0)
    spacing = _spacing(settings, diameter, volume)
    if settings.pilot_spacing is None:
        notes.append(
            f"The sample spacing of the pilot is taken to be {spacing:.4g} mm, so that the target "
            "fills it (--pilot-spacing)."
        )
    pilot = Pilot(volume, spacing)
    if settings.prior_trust == 1 and settings.prior_blur == 0:
        return pilot
    return Trusted(pilot, settings.prior_trust, math.radians(settings.prior_blur), pilot.axes)


def _choices(settings: PlanSettings, notes: list[str]) -> tuple[CameraChoice, ...]:
    choices = [choice for path in settings.camera for choice in read_cameras(path)]
    if not choices:
        choices = [USUAL]
        notes.append(
            f"The camera is taken to be {USUAL.kind.name}, with pixels of "
            f"{USUAL.kind.pixel * 1e3:g} micrometres (--camera)."
        )
    if settings.lens is not None:
        lens = open_lens(settings.lens)
        choices = [replace(c, kind=_named(c, with_lens(c.kind, lens))) for c in choices]
    return tuple(choices)


def _named(choice: CameraChoice, made: CameraType) -> CameraType:
    return replace(made, name=f"{choice.kind.name} with {made.name}")


def _constraints(
    settings: PlanSettings, choices: tuple[CameraChoice, ...], have: ViewSet | None
) -> Constraints:
    """The options as constraints, with degrees as radians: the one place where they become them.

    ``Constraints`` cannot be the settings themselves: ``up`` comes from the capture, ranges and
    costs from the camera files, regions from texts.
    """
    budget = None
    if settings.budget is not None:
        budget = Budget(settings.budget, {choice.kind.name: choice.cost for choice in choices})
    ways: dict[str, Way] = {"free": Free(), "ring": Ring(), "spline": Spline()}
    way = ways[settings.path] if settings.path in ways else TiltedRings(settings.rings)
    up: Floats = np.array([0.0, 0, 1]) if have is None else have.up
    low, high = (math.radians(angle) for angle in settings.elevation)
    first, last = (math.radians(angle) for angle in settings.azimuth)
    return Constraints(
        elevation=(low, high),
        azimuth=(first, last),
        distance=settings.distance,
        keepouts=tuple(keep_out_of(text) for text in settings.keep_out),
        cover=settings.cover,
        path=way,
        budget=budget,
        ranges={c.kind.name: Ranges(**c.ranges) for c in choices if c.ranges},
        up=(float(up[0]), float(up[1]), float(up[2])),
    )


_BODY = "body-"
_FORMS = {
    "sphere": "sphere:X,Y,Z,RADIUS",
    "box": "box:X,Y,Z,X,Y,Z",
    "cone": "cone:X,Y,Z,DX,DY,DZ,DEGREES",
}


def keep_out_of(text: str) -> KeepOut:
    """The place that a text such as ``sphere:0,0,-50,40`` names.

    ``body-`` before it says that the target is not seen through it.

    Raises:
        InputError: it is no such text, or names an impossible shape.
    """
    hides = text.startswith(_BODY)
    kind, _, rest = text.removeprefix(_BODY).partition(":")
    try:
        numbers = [float(part) for part in rest.split(",")]
    except ValueError:
        numbers = []
    if kind not in _FORMS or len(numbers) != _FORMS[kind].count(",") + 1:
        wanted = " or ".join(_FORMS.values())
        raise InputError(f"--keep-out is {text!r}, wanted {wanted}, with 'body-' before it or not")
    try:
        return KeepOut(_shape(kind, numbers), hides)
    except InputError as error:
        raise InputError(f"--keep-out {text}: {error}") from error


def _shape(kind: str, numbers: list[float]) -> Sphere | Box | Cone:
    first, second = (numbers[0], numbers[1], numbers[2]), tuple(numbers[3:6])
    if kind == "sphere":
        return Sphere(first, numbers[3])
    x, y, z = second
    if kind == "box":
        return Box(first, (x, y, z))
    return Cone(first, (x, y, z), math.radians(numbers[6]))
