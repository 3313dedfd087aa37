"""Planned views of the ornament against a ring and an even cap: what a plan is worth to splats.

Not a figure of the paper; it puts its planner to the test. Sets of as many views, at one distance,
with one lens, get the same fit, and are scored where none of them stands: off the ring, and on it.
All pictures, those that are scored too, are rendered here by ``tools/ornament`` with as many
samples, which needs the extra ``render``: captures from elsewhere may show another scene. Pictures
and fits are kept in ``fits``, and a run that was broken off goes on with both.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ornament.cameras import TARGET, Shot, around, off_path, ring, shots_at, transforms
from ornament.capture_folder import render_capture
from ornament.tracer import BACKGROUND, Tracer, choose_variant
from paper.plan import EPS2D, PRESET, Plan
from rift_cl import Device, merit
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.progress_bar import show_progress
from rift_cl.io import open_capture
from rift_cl.report.html_page import Page
from rift_cl.report.plot import Stands, camera_plot, figure_png
from rift_cl.sampling import Constraints, Target
from rift_cl.sampling import plan as plan_views

NAME = "planned_ornament"
TITLE = "Planned views of the ornament"
RING, CAP, VOLUME, SURFACE = "ring", "cap", "volume", "surface"
SETS = {
    RING: "the ring",
    CAP: "a Fibonacci cap",
    VOLUME: "planned, as a volume",
    SURFACE: "planned, as a surface",
}
ON_RING, OFF_RING = "on_ring", "off_ring"
MISSING = "Mitsuba, which renders the views, is not installed: pip install mitsuba"
# The ring's elevation in degrees, the distance of all, in radii of the ball, and the field of view.
_RISE, _DISTANCE, _FIELD = 12.0, 5.5, 45.0
# Degrees that cameras may rise, the ball with its hairs, and points on it above the base.
ELEVATIONS = (0.0, 35.0)
_DIAMETER, _POINTS, _LOWEST = 2.2, 32, -0.5
_GOLDEN_ANGLE, _SCENE = 180 * (3 - math.sqrt(5)), 0
_SCORES = {
    "off PSNR": (OFF_RING, "fit_psnr"),
    "off foreground": (OFF_RING, "fit_psnr_foreground"),
    "off SSIM": (OFF_RING, "fit_ssim"),
    "ring PSNR": (ON_RING, "fit_psnr"),
    "ring foreground": (ON_RING, "fit_psnr_foreground"),
    "ring SSIM": (ON_RING, "fit_ssim"),
}

Floats = NDArray[np.float64]


class Size(NamedTuple):
    """How large the experiment is.

    Args:
        views: of a set.
        scored: pictures of a set that is scored.
        image: (height, width) in pixels.
        samples: per pixel.
    """

    views: int
    scored: int
    image: tuple[int, int]
    samples: int

    @classmethod
    def of(cls, plan: Plan) -> Size:
        """Of the full version or the quick one."""
        return cls(64, 24, (168, 224), 256) if plan.full else cls(8, 4, (60, 80), 16)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    fit = {"steps": plan.steps, "splats": plan.splats, "eps2d": EPS2D, "seed": plan.seeds[0]}
    return {**plan.size(), **fit, "elevations": list(ELEVATIONS), **Size.of(plan)._asdict()}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The scores of one set of views after the other."""
    earlier = {row["set"]: row for row in kept.get("rows", [])}
    rows: list[dict[str, Any]] = []
    for name in SETS:
        if name not in earlier and find_spec("mitsuba") is None:
            print(MISSING, file=sys.stderr)
            yield {"rows": rows, "missing": MISSING}
            return
        rows.append(earlier.get(name) or _row(plan, name))
        yield {"rows": rows, "missing": None}


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw where the views stand, and the table."""
    page.paragraph(
        "Splats fitted to as many views of the ornament, placed in four ways: evenly on a ring at "
        f"{_RISE:g} degrees; by the golden angle, evenly in area, on the cap of elevations "
        f"{ELEVATIONS[0]:g} to {ELEVATIONS[1]:g} degrees; and where the planner puts them on that "
        "cap, told that the ornament is a volume that is seen through, or a ball whose surface "
        "points are seen from the front alone. All fits have the same settings. PSNR in dB, "
        "means over two sets of pictures that nobody trained on: off the ring, and on it."
    )
    if result["missing"]:
        page.paragraph(result["missing"])
    if not (rows := result["rows"]):
        return
    cells = [
        (SETS[row["set"]], row["views"], *(row[s] for s in _SCORES), *row["merits"].values())
        for row in rows
    ]
    page.table(
        ("views at", "count", *_SCORES, "unknown as a volume", "unknown as a surface"),
        cells,
        caption="Scores, and the planner's merit of each set, lower is better: the share that "
        "stays unknown of a volume, and of a surface's texture and appearance, added.",
    )
    groups = {}
    for row in rows:
        places = np.array(row["places"])
        forward = np.array(TARGET) - places
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        groups[SETS[row["set"]]] = Stands(places, forward)
    drawn = camera_plot(groups, center=TARGET, diameter=_DIAMETER, up=(0, 0, 1), unit="radii")
    page.figure(figure_png(drawn), caption="Where the views stand.", alt="Places of cameras")


def poses_of(name: str, size: Size, seed: int = 0) -> list[Floats]:
    """Camera-to-world poses of a set of views, to be trained on or scored."""
    if name == ON_RING:
        # Never where a view of the ring stands that is trained on.
        turns = 360 * np.arange(size.scored) / size.scored + 180 / size.views
        return [around(turn, _RISE, _DISTANCE) for turn in turns.tolist()]
    if name == OFF_RING:
        return off_path(size.scored)
    if name == RING:
        return ring(size.views, _RISE, _DISTANCE)
    turns = _cap(size.views) if name == CAP else _planned(name, size.views, seed)
    return [around(azimuth, elevation, _DISTANCE) for azimuth, elevation in turns.tolist()]


def _cap(count: int) -> Floats:
    """Azimuth and elevation in degrees, even in area, (count, 2)."""
    low, high = (math.sin(math.radians(degrees)) for degrees in ELEVATIONS)
    k = np.arange(count)
    rise = np.arcsin(low + (k + 0.5) / count * (high - low))
    return np.stack([k * _GOLDEN_ANGLE % 360, np.degrees(rise)], axis=1)


def _planned(name: str, count: int, seed: int) -> Floats:
    low, high = np.radians(ELEVATIONS).tolist()
    limits = Constraints(elevation=(low, high), distance=_DISTANCE)
    found = plan_views(targets()[name], count, limits, seed=seed)
    return np.degrees(np.stack([found.azimuth, found.elevation], axis=1))


def targets() -> dict[str, Target]:
    """The ornament as the planner may see it."""
    height = _LOWEST + (np.arange(_POINTS) + 0.5) / _POINTS * (1 - _LOWEST)
    turn, side = np.radians(_GOLDEN_ANGLE) * np.arange(_POINTS), np.sqrt(1 - height**2)
    ball = np.stack([side * np.cos(turn), side * np.sin(turn), height], axis=1)
    return {
        VOLUME: Target(TARGET, _DIAMETER),
        SURFACE: Target(TARGET, _DIAMETER, points=ball, normals=ball, mode="surface"),
    }


def _row(plan: Plan, name: str) -> dict[str, Any]:
    """The scores of a set's fit, and its merits."""
    capture = _rendered(plan, name)
    cameras = [view.camera for view in open_capture(capture).views]
    scores = _fitted(plan, name, capture)
    return {
        "set": name,
        "views": len(cameras),
        **{label: scores[group].get(key) for label, (group, key) in _SCORES.items()},
        "merits": {kind: merit(cameras, target).value for kind, target in targets().items()},
        "places": [camera.center.tolist() for camera in cameras],
    }


def _rendered(plan: Plan, name: str) -> Path:
    """The capture of a set of views."""
    folder, size = _folder(plan) / "renders" / name, Size.of(plan)
    shots = shots_at(poses_of(name, size, plan.seeds[0]), size.image, _FIELD)
    if _is_there(folder / "transforms.json", shots):
        return folder
    variant, reason = choose_variant("auto")
    print(f"{len(shots)} pictures of {name} by {variant}: {reason}", file=sys.stderr)
    tracer = Tracer(variant, seed=_SCENE, samples=size.samples)
    record = transforms(
        shots,
        background_srgb=[BACKGROUND] * 3,
        scene_seed=_SCENE,
        samples_per_pixel=size.samples,
        renderer=tracer.name,
    )
    reports = render_capture(folder, record, lambda k: tracer.picture(shots[k], k))
    show_progress(reports, quiet=False)
    return folder


def _is_there(file: Path, shots: Sequence[Shot]) -> bool:
    """Whether all pictures were rendered; those of other poses are refused later, by name."""
    if not file.exists():
        return False
    top = json.loads(file.read_text(encoding="utf-8"))
    poses = np.array([frame["transform_matrix"] for frame in top["frames"]])
    return poses.shape == (len(shots), 4, 4) and np.allclose(poses, [s.pose for s in shots])


def _fitted(plan: Plan, name: str, capture: Path) -> dict[str, dict[str, float]]:
    """Mean scores by scored set, of a fit that is done, now or by an earlier run."""
    seed = plan.seeds[0]
    asked = FitPhotosSettings.of(
        capture=capture,
        preset=PRESET,
        test=(_rendered(plan, ON_RING), _rendered(plan, OFF_RING)),
        out=_folder(plan) / f"{name}_{plan.steps}_steps_{plan.splats}_splats_seed_{seed}",
        steps=plan.steps,
        splats=plan.splats,
        seed=seed,
        eps2d=EPS2D,
        hold_out=0,
        resume=True,
        device=plan.device,
    )
    metrics = asked.out / "metrics.json"
    if not metrics.exists():
        print(f"{SETS[name]} ...", file=sys.stderr)
        show_progress(Fit(asked).run(), quiet=False)
    scores: dict[str, dict[str, float]] = json.loads(metrics.read_text(encoding="utf-8"))["scores"]
    return scores


def _folder(plan: Plan) -> Path:
    return plan.out / "fits" / f"{NAME}_{'full' if plan.full else 'quick'}"
