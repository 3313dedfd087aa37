"""Commands that write into a folder, each small enough to be run hundreds of times."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import rift_cl as rift
from rift_cl.geometry import Cone, Grid
from rift_cl.io.images.image import write_png
from rift_cl.phantom import Ellipsoid, project

# What holds dates and times; checkpoints are archives, which hold them too.
_DATED = ("config.json", "metrics.json", "report.html", "sweep.csv")
_CHECKPOINTS = "checkpoints"
# Commands that write one file, and its name in the folder that they are given here.
_FILES = {"export": "scene.spz"}


def long_commands(folder: Path) -> dict[str, list[str]]:
    """Words of one command of each kind, whose input is made in a folder.

    Some take a while, so that kills find them at work.
    """
    scan, scene = _slices(folder, 128, 24), _splats(folder)
    photographs = ["--steps", "200", "--splats", "400", "--checkpoint-every", "20"]
    return {
        **_commands(folder, photographs),
        "reconstruct": ["reconstruct", scan, "--center", "63.5", "--memory", "16M"],
        "render": ["render", scene, "--frames", "12", "--size", "160", "120", "--film", "apng"],
        "plan": ["plan", "--views", "24", "--mode", "volume"],
    }


def short_commands(folder: Path) -> dict[str, list[str]]:
    """Words of one command of each kind and of each format of volumes, as short as can be."""
    slices = ["reconstruct", _slices(folder, 32, 9), "--center", "15.5", "--format"]
    return {
        **{f"slices-{format}": [*slices, format] for format in ("tiff", "h5", "zarr", "mrc")},
        **_commands(folder, ["--steps", "6", "--splats", "60", "--checkpoint-every", "2"]),
    }


def _commands(folder: Path, fitting: list[str]) -> dict[str, list[str]]:
    """Words of one command of each kind, the fits of which take some options."""
    scan, scene, cone = _slices(folder, 32, 9), _splats(folder), _cone(folder)
    capture = _capture(folder)
    return {
        "cone": ["reconstruct", cone, "--center", "9.5"],
        "center": ["center", scan, "--span", "12", "19"],
        "analyze": ["analyze", scan, "--add", "1", "--band", "0.1"],
        "render": ["render", scene, "--frames", "3", "--size", "16", "12", "--film", "apng"],
        "fit-photos": ["fit", "photos", capture, "--hold-out", "2", *fitting],
        "fit-xray": ["fit", "xray", scan, "--center", "15.5", "--rows", "0", "2", *fitting],
        "plan": ["plan", "--views", "3", "--mode", "volume"],
        "eval": ["eval", scene, capture],
        "export": ["export", scene, "--to", "spz"],
        "sweep": ["sweep", "reconstruct", scan, "--vary", "cutoff=0.5,1", "--fixed", "center=15.5"],
    }


def started(
    words: list[str],
    out: Path,
    *more: str,
    through: tuple[str, ...] = ("-m", "rift_cl.commands.cli"),
) -> subprocess.Popen[str]:
    """A command that was started, which writes into the folder ``out``.

    Pages are entitled by the folder's name, so that runs to be compared take folders of one name.

    Args:
        words: the command.
        out: its folder.
        *more: further words.
        through: what Python is told to run.
    """
    out.parent.mkdir(exist_ok=True)
    place = out
    if words[0] in _FILES:
        out.mkdir(exist_ok=True)
        place = out / _FILES[words[0]]
    command = [sys.executable, *through, *words, "--out", str(place), "--quiet", *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def resumed(words: list[str], out: Path) -> subprocess.Popen[str]:
    """A command that goes on with what it left in ``out``; one that writes one file begins anew."""
    return started(words, out, "--overwrite" if words[0] in _FILES else "--resume")


def left_in(out: Path) -> dict[str, bytes]:
    """The files of a folder by their names in it, but for those that hold dates and times."""
    found = {path.relative_to(out).as_posix(): path for path in out.rglob("*") if path.is_file()}
    return {
        name: path.read_bytes()
        for name, path in found.items()
        if path.name not in _DATED and path.parent.name != _CHECKPOINTS
    }


def differing(one: dict[str, bytes], other: dict[str, bytes]) -> list[str]:
    """Names of files that are in one of two folders alone, or hold other bytes."""
    return sorted(name for name in {*one, *other} if one.get(name) != other.get(name))


def _slices(folder: Path, bins: int, rows: int) -> str:
    grid = Grid((3 * bins // 4, 3 * bins // 4))
    scan = rift.Parallel(np.arange(bins) * np.pi / bins, bins)
    slices = np.repeat(rift.phantom.shepp_logan_sinogram(grid, scan)[:, None], rows, axis=1)
    path = folder / f"scan-{bins}.npz"
    np.savez(path, projections=slices, angles=scan.angles)
    return str(path)


def _cone(folder: Path) -> str:
    angles = 2 * np.pi * np.arange(24) / 24
    cone = Cone(angles, 16, 20, 2.0, 60.0, 120.0)
    path = folder / "cone.npz"
    lengths = {"source_to_axis": 60.0, "source_to_detector": 120.0, "pitch": 2.0}
    views = project([Ellipsoid.ball(5.0, 0.02)], Grid((2, 2, 2)), cone)
    np.savez(path, projections=views, angles=angles, **lengths)
    return str(path)


def _capture(folder: Path) -> str:
    """Four photographs of no scene in particular, from a ring of cameras round its middle."""
    drawn, frames = np.random.default_rng(1), []
    path = folder / "capture"
    path.mkdir(exist_ok=True)
    for number, turn in enumerate((0.0, 1.5, 3.0, 4.5)):
        back = np.array([np.cos(turn), np.sin(turn), 0.0])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        pose = np.eye(4)
        pose[:3] = np.stack([right, np.cross(back, right), back, 4 * back], axis=1)
        write_png(path / f"{number}.png", drawn.uniform(size=(24, 32, 3)).astype(np.float32))
        frames.append({"file_path": f"{number}.png", "transform_matrix": pose.tolist()})
    lens = {"fl_x": 32.0, "fl_y": 32.0, "cx": 16.0, "cy": 12.0, "w": 32, "h": 24}
    (path / "transforms.json").write_text(json.dumps({**lens, "frames": frames}))
    return str(path)


def _splats(folder: Path) -> str:
    drawn = np.random.default_rng(0)
    splats = rift.SplatScene(
        means=drawn.normal(size=(200, 3)),
        log_scales=np.full((200, 3), -2.0),
        quats=np.tile([1.0, 0, 0, 0], (200, 1)),
        logit_opacities=np.full(200, 3.0),
        sh=drawn.normal(size=(200, 1, 3)),
    )
    path = folder / "scene.ply"
    splats.save(path)
    return str(path)
