"""Render captures that face their subject from one side, by the path tracer of the ornament.

    python tools/render_one_sided.py --scene wall --out wall
    python tools/render_one_sided.py --scene shelf --views 40 --size 256 192 --out shelf

People photograph what hangs on walls and stands in corners, and walk to and fro before it; a full
ring round a ball shows nothing of what goes wrong then. What comes out is a capture in the
convention of NeRF and nerfstudio: images, transforms.json, and points.ply with points that lie
exactly on the surfaces, as many as COLMAP would find. A run that is stopped goes on where it was.
Needs the extra ``render``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro

from one_sided.cameras import walk
from one_sided.scene import SCENES, SUBJECT
from ornament.cameras import Shot, shots_at, transforms
from ornament.capture_folder import render_capture
from ornament.command import run
from ornament.tracer import Tracer, choose_variant
from rift_cl.commands.progress_bar import print_line, show_progress
from rift_cl.errors import InputError
from rift_cl.io import read_image
from rift_cl.io.captures.point_cloud import write_point_cloud

_POINTS = "points.ply"


@dataclass(frozen=True)
class Settings:
    """Render a wall or a shelf, as a person with a camera in the hand sees it."""

    scene: Literal["wall", "shelf"] = "wall"
    """What is before the cameras; its middle is the origin, x to the right, z up."""
    out: Path = Path("one_sided")
    """Folder for images, points.ply and transforms.json; pictures that are there are kept."""
    views: int = 40
    """Number of cameras; every 8th is held out by 'rift fit'."""
    distance: float = 5.0
    """Of the cameras from the subject's middle, which is 2 units high."""
    size: tuple[int, int] = (224, 168)
    """Width and height in pixels."""
    field: float = 45.0
    """Horizontal field of view in degrees."""
    points: int = 2400
    """Sparse points, about so many."""
    format: Literal["png", "jpg"] = "png"
    """Of the pictures; JPEG (quality 85) is smaller, and what cameras give."""
    samples: int = 192
    """Paths per pixel, at least; the noise falls with their square root."""
    seed: int = 0
    """Of what is painted, of the cameras, and of the noise."""
    variant: str = "auto"
    """Mitsuba's: llvm_ad_rgb (fast), scalar_rgb (slow, needs no libLLVM), cuda_ad_rgb."""


def main() -> int:
    """Render what was asked for."""
    settings = tyro.cli(Settings, description=__doc__)
    return run("render_one_sided", lambda: _render(settings))


def _render(settings: Settings) -> None:
    shots = shots_of(settings)
    variant, reason = choose_variant(settings.variant)
    print_line(f"Mitsuba renders with {variant}: {reason}")
    tracer = Tracer(
        variant, seed=settings.seed, samples=settings.samples, scenes=SCENES[settings.scene]
    )
    record = record_of(settings, shots, tracer.name)
    reports = render_capture(settings.out, record, lambda k: tracer.picture(shots[k], k))
    show_progress(reports, quiet=False)
    share = settings.points / len(shots)
    write_points(settings.out, record, share, lambda k: tracer.places(shots[k], k))
    print_line(f"{len(shots)} pictures, {_POINTS} and transforms.json are in {settings.out}")


def shots_of(settings: Settings) -> list[Shot]:
    """The cameras that settings ask for.

    Raises:
        InputError: a setting makes no sense.
    """
    demands = {
        "views": (settings.views >= 3, "3 or more"),
        "points": (settings.points >= settings.views, "one for each view or more"),
        "samples": (settings.samples >= 1, "1 or more"),
        "seed": (settings.seed >= 0, "0 or more"),
        "size": (min(settings.size) >= 1, "a width and a height, each 1 or more"),
        "distance": (2.5 <= settings.distance <= 8, "2.5 to 8"),
        "field": (10 <= settings.field <= 60, "10 to 60 degrees, lest the wall's end be seen"),
    }
    for name, (fine, wanted) in demands.items():
        if not fine:
            raise InputError(f"--{name} is {getattr(settings, name)}, wanted {wanted}")
    poses = walk(settings.views, settings.seed, settings.distance)
    return shots_at(poses, settings.size[::-1], settings.field)


def record_of(settings: Settings, shots: list[Shot], renderer: str) -> dict[str, Any]:
    """The content of transforms.json."""
    return transforms(
        shots,
        f".{settings.format}",
        ply_file_path=_POINTS,
        scene=settings.scene,
        subject_half_size=list(SUBJECT[settings.scene]),
        scene_seed=settings.seed,
        samples_per_pixel=settings.samples,
        renderer=renderer,
    )


def write_points(out: Path, record: dict[str, Any], share: float, places: Any) -> None:
    """Write sparse points that lie on the surfaces, with the colours of the pictures.

    Args:
        out: the folder of a finished capture.
        record: the content of its transforms.json.
        share: points for each picture.
        places: gives what frame ``number`` sees as (height, width, 3) places.
    """
    random, points, colors = np.random.default_rng((record["scene_seed"], 0x901)), [], []
    for number, frame in enumerate(record["frames"]):
        seen = places(number).reshape(-1, 3)
        pixels = random.choice(len(seen), max(1, round(share)), replace=False)
        points.append(seen[pixels])
        colors.append(read_image(out / frame["file_path"]).reshape(-1, 3)[pixels])
    write_point_cloud(out / _POINTS, np.concatenate(points), np.concatenate(colors))


if __name__ == "__main__":
    sys.exit(main())
