"""What is analysed: a capture or a scan is opened, and its target found or assumed."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.cameras.arc import check_places
from rift_cl.commands.inputs.scan_axis import find_axis
from rift_cl.commands.inputs.scan_input import ScanArrays
from rift_cl.commands.inputs.scene_bounds import SceneBounds, bounds_of_cameras
from rift_cl.commands.inputs.scene_depth import space_of
from rift_cl.commands.inputs.surfaces import trusted
from rift_cl.commands.inputs.view_set import Floats, ViewSet, points_of
from rift_cl.commands.options import absolute_paths
from rift_cl.errors import InputError
from rift_cl.geometry import Camera, Cone, Parallel, Scan, Vectors
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.scan_cameras import scan_cameras
from rift_cl.geometry.seen_grid import scan_lengths, seen_grid
from rift_cl.io.captures.capture import (
    Capture,
    capture_name,
    holds_bare_photographs,
    holds_capture,
    open_capture,
)
from rift_cl.io.captures.photograph_folder import photographs_in
from rift_cl.io.captures.video import holds_video
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.io.scans.tiff_folder import grouped_names
from rift_cl.reconstruct.direct.offset_axis import sees_further
from rift_cl.sampling.targets.target import Target

# Share of the sparse points that a target holds.
_INSIDE = 0.9
_SEEN_THROUGH = "What views sample is counted as for a target that is seen through."
_OPAQUE = (
    "The target is taken to be opaque, with a sphere for its surface (--mode volume is for "
    "transparent ones)."
)
# Options of a scan's values, which the search for its axis alone reads.
_OF_VALUES = "flats", "darks", "kind", "background"
# Nanometres in a millimetre.
_NANO = 1e6


def open_sampled(settings: AnalyzeSettings) -> ViewSet:
    """The views that the settings name; see ``open_views``."""
    return open_views(settings)[0]


def open_views(settings: AnalyzeSettings) -> tuple[ViewSet, AnalyzeSettings]:
    """The views of a capture or of a scan with their target, and the settings as decided.

    The settings have a value for everything that was left open and is one number for all views.

    Raises:
        RiftError: the file cannot be read, or an option does not belong to it.
    """
    path = settings.source
    if holds_capture(path):
        return _capture(settings)
    try:
        return _scan(settings)
    except InputError as error:
        if not _bare(path):
            raise
        raise InputError(
            f"{path}: photographs without cameras: run 'rift fit' first, then 'rift analyze FIT'"
        ) from error


def _bare(path: Path) -> bool:
    """Whether a path is a video, or a folder of photographs that can be no projections."""
    if holds_video(path):
        return True
    return holds_bare_photographs(path) and not grouped_names(photographs_in(path).path)


def _capture(settings: AnalyzeSettings) -> tuple[ViewSet, AnalyzeSettings]:
    for field in fields(ScanArrays):
        if getattr(settings, field.name) != field.default:
            option = field.name.replace("_", "-")
            raise InputError(f"--{option} applies to scans, {settings.source} is a capture")
    capture = open_capture(settings.source, photographs=False)
    cameras = [view.camera for view in capture.views]
    check_places(cameras, settings.source)
    bounds = bounds_of_cameras(cameras, points=capture.points)
    center, diameter, notes = _ball(settings, capture, cameras, bounds)
    lens, more = _with_lens(settings, cameras, center)
    sampled = ViewSet(
        name=capture_name(settings.source),
        target=_target(settings, center, diameter, bounds.up, flat=False),
        up=bounds.up,
        unit="unit" if settings.unit is None else "mm",
        cameras=tuple(lens),
        facts={"views": len(cameras)},
        notes=(*notes, *more, _SEEN_THROUGH if settings.mode == "volume" else _OPAQUE),
        opaque=settings.mode != "volume",
    )
    if sampled.opaque:
        sampled = _with_space(sampled, settings, capture)
    x, y, z = center.tolist()
    decided = replace(
        absolute_paths(settings),
        mode="surface" if sampled.opaque else "volume",
        center=(x, y, z),
        diameter=diameter,
    )
    if settings.unit is None:
        return sampled, replace(decided, band=sampled.target.highest)
    return in_millimetres(sampled, settings.unit), decided


def _with_space(sampled: ViewSet, settings: AnalyzeSettings, capture: Capture) -> ViewSet:
    """The views with free space estimated from splats or sparse points."""
    space, known = space_of(settings.source, sampled.cameras, capture.points, settings.device)
    if space is None:
        return sampled
    if not trusted(space, sampled):
        note = f"According to {known} many cameras do not see the target: they are not used."
        return replace(sampled, notes=(*sampled.notes, note))
    note = f"Geometry and occlusion are known from {known}."
    return replace(sampled, space=space, notes=(*sampled.notes, note))


def _ball(
    settings: AnalyzeSettings, capture: Capture, cameras: list[Camera], bounds: SceneBounds
) -> tuple[Floats, float, list[str]]:
    """The target's middle and diameter, and what had to be assumed for them."""
    notes = []
    center = bounds.center
    if settings.center is not None:
        center = np.array(settings.center)
    else:
        notes.append("The target's centre is taken to be where the cameras look (--center).")
        if len(cameras) == 1:
            notes.append("A single camera does not determine its distance: give --center.")
    if settings.diameter is not None:
        return center, settings.diameter, notes
    diameter, why = shown_diameter(cameras, center), "what the pictures show"
    if capture.points is not None:
        away = np.linalg.norm(capture.points - center, axis=1)
        extent = 2 * float(np.quantile(away, _INSIDE))
        if 0 < extent < diameter:
            diameter, why = extent, f"what holds {_INSIDE:.0%} of the sparse points"
    shown = f"{diameter:.4g}" if settings.unit is None else f"{diameter * settings.unit:.4g} mm"
    notes.append(f"The target's diameter, {shown}, is taken to be {why} (--diameter).")
    return center, diameter, notes


def shown_diameter(cameras: list[Camera], center: Floats) -> float:
    """Diameter of the largest ball about a point that the shorter edge of most pictures shows."""
    shown = []
    for camera in cameras:
        fx, fy = camera.intrinsics[:2]
        distance = float(np.linalg.norm(camera.center - center))
        edge = min(camera.width / fx, camera.height / fy) / 2
        # Those of an orthographic camera are lengths, the others' are tangents.
        half = edge if camera.model == "ortho" else distance * edge / np.hypot(1, edge)
        shown.append(2 * half)
    return float(np.median(shown))


def _with_lens(
    settings: AnalyzeSettings, cameras: list[Camera], center: Floats
) -> tuple[list[Camera], list[str]]:
    """The cameras with the opening that options give to those without one."""
    wavelength = 0.0 if settings.unit is None else settings.wavelength / _NANO / settings.unit
    notes, made = [], []
    for camera in cameras:
        lens = camera.aperture
        if lens is None and settings.aperture is not None:
            depth = float(camera.view[2, :3] @ center + camera.view[2, 3])
            lens = Aperture(settings.aperture, settings.focus or max(depth, 1e-9), wavelength)
        elif lens is not None and not lens.wavelength:
            lens = replace(lens, wavelength=wavelength)
        made.append(Camera(camera.size, camera.K, camera.view, camera.model, lens))
    if all(camera.aperture is None for camera in made):
        notes.append(
            "The cameras are taken as pinholes: give the radius of the lens aperture (--aperture) "
            "to include depth of field and diffraction."
        )
    elif not wavelength and not any(c.aperture and c.aperture.wavelength for c in made):
        notes.append("Diffraction is left out: it needs millimetres per unit (--unit).")
    return made, notes


def in_millimetres(sampled: ViewSet, unit: float) -> ViewSet:
    """The same views in millimetres, given the millimetres per world unit."""
    target = sampled.target
    band = None if target.band is None else target.band / unit
    scaled = replace(
        target,
        center=target.center * unit,
        diameter=target.diameter * unit,
        points=target.points * unit,
        band=band,
    )
    cameras = tuple(scaled_camera(camera, unit) for camera in sampled.cameras)
    space = None if sampled.space is None else sampled.space.scaled(unit)
    return replace(sampled, target=scaled, cameras=cameras, unit="mm", space=space)


def scaled_camera(camera: Camera, unit: float) -> Camera:
    """The same camera where every length is multiplied by a factor."""
    view, K = camera.view.copy(), camera.K.copy()
    view[:3, 3] *= unit
    if camera.model == "ortho":
        K[:2, :2] /= unit
    lens = camera.aperture
    if lens is not None:
        lens = Aperture(lens.radius * unit, lens.focus * unit, lens.wavelength * unit)
    return Camera(camera.size, K, view, camera.model, lens)


def _target(
    settings: AnalyzeSettings,
    center: Floats,
    diameter: float,
    up: Floats,
    *,
    flat: bool,
    lopsided: bool = False,
) -> Target:
    named = points_of(center, diameter, up, flat=flat, lopsided=lopsided)
    points = np.array(list(named.values()))
    if flat:
        return Target.flat(diameter, center, points=points, band=settings.band)
    return Target(center=center, diameter=diameter, points=points, band=settings.band)


def _scan(settings: AnalyzeSettings) -> tuple[ViewSet, AnalyzeSettings]:
    if settings.mode == "surface":
        raise InputError(f"--mode surface applies to captures, {settings.source} is a scan")
    for name in ("center", "aperture", "focus", "unit"):
        if getattr(settings, name) is not None:
            raise InputError(f"--{name} applies to captures, {settings.source} is a scan")
    file = settings.open_file(settings.source, values=False)
    up = np.array([0.0, 0, 1])
    pitch, unit = (file.pitch, file.unit or "unit") if file.pitch else (1.0, "bin")
    notes = list(file.notes)
    if file.pitch is None:
        notes.append("The file gives no detector pitch: lengths are in bins.")
    cameras, scan, edge = _rays(settings, file, pitch, notes)
    center = np.zeros(3) if file.cone is None else np.array(seen_grid(file.cone).center[::-1])
    across, lopsided = _shown(file.geometry if scan is None else scan)
    diameter = edge * across if settings.diameter is None else settings.diameter
    if settings.diameter is None:
        notes.append(
            f"The target's diameter, {diameter:.4g} {unit}, is taken to be what the detector shows "
            "(--diameter)."
        )
    # A scan resolves half a cycle per bin at most.
    decided = replace(
        absolute_paths(settings),
        mode="volume",
        diameter=diameter,
        band=settings.band or 0.5 / edge,
    )
    sampled = ViewSet(
        name=Path(file.path).name,
        target=_target(decided, center, diameter, up, flat=file.cone is None, lopsided=lopsided),
        up=up,
        unit=unit,
        cameras=cameras,
        scan=scan,
        orbit=file.cone,
        lopsided=lopsided,
        facts={"projections": file.shape[0], "rows": file.shape[1], "bins": file.shape[2]},
        notes=tuple(notes),
    )
    return sampled, decided


def _rays(
    settings: AnalyzeSettings, file: ScanFile, pitch: float, notes: list[str]
) -> tuple[tuple[Camera, ...], Parallel | None, float]:
    """Cameras of a fan or cone beam or parallel rays, and the edge of a bin at the axis."""
    scan = file.geometry
    if not isinstance(scan, Parallel):
        return scan_cameras(scan).cameras, None, scan_lengths(scan).pixel[1]
    return (), Parallel(file.angles, file.shape[2], pitch, _axis(settings, notes)), pitch


def _shown(scan: Scan) -> tuple[float, bool]:
    """Bins that detectors show across the axis, and whether they do so on one side alone."""
    if isinstance(scan, Vectors):
        return scan.bins, False
    bin = scan.center[1] if isinstance(scan, Cone) else scan.center
    if not sees_further(bin, scan.bins):
        return scan.bins, False
    return 2 * max(bin + 0.5, scan.bins - 0.5 - bin), True


def _axis(settings: AnalyzeSettings, notes: list[str]) -> float | None:
    """Bin of the rotation axis, None for the middle: a file is analysed even if it hides it.

    Raises:
        InputError: what was said of the values is not so.
    """
    try:
        file = settings.open_file(settings.source)
    except InputError as error:
        if any(getattr(settings, name) is not None for name in _OF_VALUES):
            raise
        notes.append(_middle(error))
        return None
    try:
        found = find_axis(file)
    except InputError as error:
        notes.append(_middle(error))
        return None
    notes.append(f"The rotation axis was found {found.in_words()}.")
    return found.center


def _middle(error: InputError) -> str:
    return (
        "The rotation axis is taken to be at the middle of the detector, since it was not found: "
        f"{error}"
    )
