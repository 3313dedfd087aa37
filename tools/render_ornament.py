"""Render a glossy ornament with hairs and fibres by an independent path tracer, Mitsuba 3.

    python tools/render_ornament.py --views 64 --samples 512 --out ornament
    python tools/render_ornament.py --off-path --views 24 --out ornament/off_path
    python tools/render_ornament.py --cameras capture/transforms.json --out same_cameras

It stands in for the photographs of the paper "RiFT", which are not published: poses and lenses are
known exactly, and the background is one constant grey without noise. What comes out is a capture
in the convention of NeRF and nerfstudio: images/*.png and transforms.json. A run that is stopped
goes on where it was. Needs the extra ``render``.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from ornament.cameras import (
    Shot,
    off_path,
    ring,
    shots_at,
    shots_of_file,
    transforms,
    with_aperture,
)
from ornament.capture_folder import render_capture
from ornament.command import run
from ornament.tracer import BACKGROUND, Tracer, choose_variant
from rift_cl.commands.progress_bar import print_line, show_progress
from rift_cl.errors import InputError

_SIZE = (224, 168)
# Nearer than this a camera stands among the hairs, further away behind the lights.
_NEAREST, _FURTHEST = 2.0, 9.0


@dataclass(frozen=True)
class Settings:
    """Render the ornament from a ring of cameras, from off that ring, or from any cameras."""

    out: Path = Path("ornament")
    """Folder for images/*.png and transforms.json; pictures that are there are kept."""
    views: int = 64
    """Number of built-in cameras."""
    elevation: float = 12.0
    """Of the ring, in degrees."""
    distance: float = 5.5
    """Of the ring from the ornament, whose ball has radius 1."""
    off_path: bool = False
    """Azimuths by the golden angle, elevations 2 to 30 degrees, distances 5 to 6."""
    cameras: Path | None = None
    """A transforms.json whose cameras are taken in place of the built-in ones."""
    size: tuple[int, int] | None = None
    """Width and height in pixels; 224 168, or what the file of --cameras says."""
    field: float = 45.0
    """Horizontal field of view of the built-in cameras, in degrees."""
    aperture_radius: float | None = None
    """Of a thin lens, in the scene's units; 0 for a pinhole."""
    focus_distance: float | None = None
    """What is sharp, along the optical axis; wanted with an aperture."""
    samples: int = 256
    """Paths per pixel, at least; the noise falls with their square root."""
    seed: int = 0
    """Of the scene's hairs and fibres, and of the noise."""
    variant: str = "auto"
    """Mitsuba's: llvm_ad_rgb (fast), scalar_rgb (slow, needs no libLLVM), cuda_ad_rgb."""


def main() -> int:
    """Render what was asked for."""
    settings = tyro.cli(Settings, description=__doc__)
    return run("render_ornament", lambda: _render(settings))


def _render(settings: Settings) -> None:
    shots = shots_of(settings)
    variant, reason = choose_variant(settings.variant)
    print_line(f"Mitsuba renders with {variant}: {reason}")
    tracer = Tracer(variant, seed=settings.seed, samples=settings.samples)
    record = record_of(settings, shots, tracer.name)
    reports = render_capture(settings.out, record, lambda k: tracer.picture(shots[k], k))
    show_progress(reports, quiet=False)
    print_line(f"{len(shots)} pictures and transforms.json are in {settings.out}")


def shots_of(settings: Settings) -> list[Shot]:
    """The cameras that settings ask for.

    Raises:
        RiftError: a setting makes no sense, or a file of cameras cannot be used.
    """
    _check(settings)
    size = None if settings.size is None else (settings.size[1], settings.size[0])
    if settings.cameras is not None:
        shots = shots_of_file(settings.cameras, size)
    else:
        poses = (
            off_path(settings.views)
            if settings.off_path
            else ring(settings.views, settings.elevation, settings.distance)
        )
        shots = shots_at(poses, size or _SIZE[::-1], settings.field)
    return [with_aperture(s, settings.aperture_radius, settings.focus_distance) for s in shots]


def record_of(settings: Settings, shots: list[Shot], renderer: str) -> dict[str, Any]:
    """The content of transforms.json."""
    return transforms(
        shots,
        background_srgb=[BACKGROUND] * 3,
        scene_seed=settings.seed,
        samples_per_pixel=settings.samples,
        renderer=renderer,
    )


def _check(settings: Settings) -> None:
    size = settings.size or _SIZE
    demands = {
        "views": (settings.views >= 1, "1 or more"),
        "samples": (settings.samples >= 1, "1 or more"),
        "seed": (settings.seed >= 0, "0 or more"),
        "size": (min(size) >= 1, "a width and a height, each 1 or more"),
        "elevation": (abs(settings.elevation) < 90, "degrees between -90 and 90"),
        "distance": (
            _NEAREST <= settings.distance <= _FURTHEST,
            f"{_NEAREST:g} to {_FURTHEST:g}",
        ),
        "field": (0 < settings.field < 180 and math.isfinite(settings.field), "0 to 180 degrees"),
    }
    for name, (fine, wanted) in demands.items():
        if not fine:
            raise InputError(f"--{name} is {getattr(settings, name)}, wanted {wanted}")


if __name__ == "__main__":
    sys.exit(main())
