"""What priors for surfaces do to fits of photographs, where the answer is known.

    python tools/measure_surfaces.py --ornament ornament/orbit --captures lego --out surfaces
    python tools/measure_surfaces.py --out surfaces --markdown docs/benchmarks/surfaces.md

The ornament's ball has radius 1 about the origin, so that depth and normals of a fit can be
compared with it. Of the captures the eighth of the photographs that stand highest is not fitted,
and scored: views from beyond those that were fitted. Views that a final judgement is to be made on
must not be among them. Each fit leaves its measures in --out, and a run that is stopped goes on
where it was.
"""

from __future__ import annotations

import json
import shutil
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args

import numpy as np
import tyro
from numpy.typing import NDArray

import rift_cl as rift
from bench.command import say
from bench.surroundings import in_words, surroundings
from bench.table import NONE, Table, markdown_lines, show
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.commands.pictures.depth_picture import depth_and_alpha
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.pictures.normal_picture import NormalPictures
from rift_cl.geometry import Camera
from rift_cl.io import write_text
from rift_cl.io.captures.capture import open_capture
from rift_cl.splat.renderer import Renderer

Settings = Mapping[str, Any]
Kind = Literal["expected", "median"]
Floats = NDArray[np.float64]
VARIANTS: dict[str, Settings] = {
    "mcmc": {"strategy": "mcmc"},
    "defaults": {},
    "opacities penalised": {"strategy.opacity_penalty": 0.01},
    "flatness": {"surface.flatness": 0.5},
    "opacity entropy": {"surface.opacity_entropy": 0.01},
    "normal consistency, flatness": {
        "surface.normal_consistency": 0.01,
        "surface.flatness": 0.15,
    },
    "more normal consistency": {"surface.normal_consistency": 0.1},
    "preset surface": PRESETS["surface"],
}
# Cameras that look at the ball, its part that faces them (cosine), and what counts as solid.
_CAMERAS, _FACING, _SOLID = 16, 0.3, 0.5
# The share of the photographs that stand highest.
_BEYOND = 8


@dataclass(frozen=True)
class Options:
    """Measure what priors for surfaces do.

    Args:
        ornament: capture of the ornament; none if not given.
        captures: whose highest photographs are scored: a transforms.json each.
        steps: of each fit.
        splats: of each fit.
        downscale: of the photographs.
        seed: of each fit.
        variants: by name; all if not given.
        out: folder for the measures.
        markdown: file for the table.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    ornament: Path | None = None
    captures: tuple[Path, ...] = ()
    steps: int = 1000
    splats: int = 8000
    downscale: int = 2
    seed: int = 0
    variants: tuple[str, ...] = tuple(VARIANTS)
    out: Path = Path("rift-surfaces")
    markdown: Path | None = None
    device: str | None = None


def measure_all(options: Options) -> None:
    """Fit and measure what was not measured before."""
    options.out.mkdir(parents=True, exist_ok=True)
    for variant in options.variants:
        for capture in (options.ornament, *options.captures):
            if capture is None:
                continue
            name = f"{capture.parent.name}-{capture.name}-{variant}-{options.seed}"
            path = options.out / f"{name.replace(' ', '_')}.json"
            if not path.is_file():
                say(name)
                found = _measured(options, variant, capture)
                write_text(path, json.dumps(found, indent=1) + "\n")


def _measured(options: Options, variant: str, capture: Path) -> dict[str, Any]:
    of_ball = capture == options.ornament
    with TemporaryDirectory() as folder:
        low, high = (capture, None) if of_ball else _split(capture, Path(folder))
        began = time.process_time()
        out = Path(folder) / "fit"
        fitted = rift.fit(
            low,
            kind="photos",
            out=out,
            hold_out=_BEYOND if of_ball else 0,
            test=() if high is None else (high,),
            steps=options.steps,
            splats=options.splats,
            downscale=options.downscale,
            seed=options.seed,
            device=options.device,
            **VARIANTS[variant],
        )
        took = time.process_time() - began
        scores = next(iter(fitted.metrics["scores"].values()))
        record = {"variant": variant, "what": "ball" if of_ball else capture.name, "cpu_s": took}
        record |= {"psnr": scores["fit_psnr"]}
        return {**record, **_ball(out, capture, options)} if of_ball else record


def _split(capture: Path, folder: Path) -> tuple[Path, Path]:
    """A capture without the photographs that stand highest, and these; copies."""
    record = json.loads((capture / "transforms.json").read_text(encoding="utf-8"))
    frames = sorted(record["frames"], key=lambda frame: frame["transform_matrix"][2][3])
    fewest = len(frames) - len(frames) // _BEYOND
    parts = {"low": frames[:fewest], "high": frames[fewest:]}
    for name, part in parts.items():
        for frame in part:
            copy = folder / name / frame["file_path"]
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(capture / frame["file_path"], copy)
        part.sort(key=lambda frame: frame["file_path"])
        write_text(folder / name / "transforms.json", json.dumps({**record, "frames": part}))
    return folder / "low", folder / "high"


def _ball(fit: Path, capture: Path, options: Options) -> dict[str, float]:
    """Medians over what cameras see of the ball: errors of depth, in its radius, and of normals."""
    scene, device = OpenedScene(SceneInput(fit)), rift.open_device(options.device)
    renderer = Renderer(scene.rendering, device=device)
    splats = scene.splats.upload(device)
    normals = NormalPictures(renderer, scene.splats, splats)
    views = open_capture(capture, photographs=False).views
    aside: dict[str, list[Floats]] = {"expected": [], "median": []}
    turned: list[Floats] = []
    for number in evenly(len(views), _CAMERAS):
        camera = views[number].camera
        true_depth, true_normals, facing = ball_seen(camera)
        for kind in get_args(Kind):
            depth, alpha = depth_and_alpha(renderer, splats, camera, kind)
            counts = (facing > _FACING) & (alpha > _SOLID)
            aside[kind].append(np.abs(depth - true_depth)[counts])
        cosines = (normals.seen(camera)[0] * true_normals).sum(axis=2)[counts]
        turned.append(np.degrees(np.arccos(np.clip(cosines, -1, 1))))
    return {
        **{kind: float(np.median(np.concatenate(found))) for kind, found in aside.items()},
        "normals": float(np.median(np.concatenate(turned))),
    }


def ball_seen(camera: Camera) -> tuple[Floats, Floats, Floats]:
    """The ball of radius 1 about the origin in a pinhole's pixels.

    Returns:
        (height, width) depths along the camera's axis, (height, width, 3) normals, and
        (height, width) cosines of the angles at which it is seen; -1 where it is not.
    """
    fx, fy, cx, cy = camera.intrinsics
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    ways = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=2) @ camera.view[:3, :3]
    square, along = (ways**2).sum(axis=2), ways @ camera.center
    inside = along**2 - square * (camera.center @ camera.center - 1)
    depth = (-along - np.sqrt(np.maximum(inside, 0))) / square
    normals = camera.center + depth[..., None] * ways
    facing = -(normals * ways).sum(axis=2) / np.sqrt(square)
    return depth, normals, np.where(inside > 0, facing, -1.0)


def tables(found: Sequence[Mapping[str, Any]]) -> Iterator[Table]:
    """A row for each variant, and what the variants are."""
    rows = {(one["variant"], one["what"]): one for one in found}
    others = sorted({what for _, what in rows} - {"ball"})
    names = [name for name in VARIANTS if any(variant == name for variant, _ in rows)]
    beyond = [f"{name}, beyond" for name in others]
    head = ("variant", "ball: expected depth off", "median depth off", "normals off", "held out")
    yield Table(
        "Surfaces",
        (*head, *beyond),
        [
            (
                name,
                *_of_ball(rows.get((name, "ball"))),
                *(_decibels(rows.get((name, other))) for other in others),
            )
            for name in names
        ],
        (
            "Ball: medians of the errors of expected and of median depth, in radii, and of the "
            "angle between normals, in degrees; mean PSNR of held-out views on the same ring. "
            "Beyond: mean PSNR of the eighth of the photographs that stand highest, which were not "
            "fitted.",
        ),
    )
    settings = [(name, _words(VARIANTS[name])) for name in names]
    yield Table("What the variants change", ("variant", "options"), settings, texts=2)


def _of_ball(one: Mapping[str, Any] | None) -> tuple[str, ...]:
    if one is None:
        return NONE, NONE, NONE, NONE
    depths = (f"{one[kind]:.3f}" for kind in get_args(Kind))
    return *depths, f"{one['normals']:.1f}", _decibels(one)


def _decibels(one: Mapping[str, Any] | None) -> str:
    return NONE if one is None else f"{one['psnr']:.2f}, {one['cpu_s']:.0f} s"


def _words(settings: Settings) -> str:
    options = [(name.replace("_", "-"), value) for name, value in settings.items()]
    return " ".join(
        f"`--{name} {value if isinstance(value, str) else f'{value:g}'}`" for name, value in options
    )


def page(options: Options, found: Sequence[Mapping[str, Any]], device: rift.Device) -> str:
    """The tables as a page, with the device named."""
    lines = [
        "<!-- Generated by tools/measure_surfaces.py; do not edit. -->",
        "# Priors for surfaces",
        "",
        "    python tools/measure_surfaces.py --ornament ORBIT --captures LEGO --out surfaces",
        "",
        f"{in_words(surroundings(device))} {options.steps} steps, {options.splats} splats, "
        f"photographs / {options.downscale}, seed {options.seed}; processor seconds on a busy "
        "machine.",
    ]
    return "\n".join([*lines, *markdown_lines(tables(found))]) + "\n"


def main() -> int:
    """Measure with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    unknown = [name for name in options.variants if name not in VARIANTS]
    if unknown:
        say(f"measure_surfaces: no variant {unknown[0]!r}; there are {', '.join(VARIANTS)}")
        return 2
    try:
        measure_all(options)
    except rift.RiftError as error:
        say(f"measure_surfaces: {error}")
        return error.exit_status
    found = [json.loads(path.read_text("utf-8")) for path in sorted(options.out.glob("*.json"))]
    if found:
        show(tables(found))
        if options.markdown is not None:
            text = page(options, found, rift.open_device(options.device))
            write_text(options.markdown, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
