"""Commands that write into a folder, each small enough to be run hundreds of times."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

import rift_cl as rift
from rift_cl.geometry import Cone, Grid
from rift_cl.phantom import Ellipsoid, project

# What holds dates and times.
_DATED = ("config.json", "metrics.json", "report.html", "sweep.csv")


def long_commands(folder: Path) -> dict[str, list[str]]:
    """Words of commands that take a while, whose input is made in a folder."""
    scan, scene = _slices(folder, 128, 24), _splats(folder)
    return {
        "reconstruct": ["reconstruct", scan, "--center", "63.5", "--memory", "16M"],
        "render": ["render", scene, "--frames", "12", "--size", "160", "120", "--film", "apng"],
    }


def short_commands(folder: Path) -> dict[str, list[str]]:
    """Words of one command of each kind and of each format of volumes, as short as can be."""
    scan, scene, cone = _slices(folder, 32, 9), _splats(folder), _cone(folder)
    slices = ["reconstruct", scan, "--center", "15.5", "--format"]
    return {
        **{f"slices-{format}": [*slices, format] for format in ("tiff", "h5", "zarr", "mrc")},
        "cone": ["reconstruct", cone, "--center", "9.5"],
        "center": ["center", scan, "--span", "12", "19"],
        "analyze": ["analyze", scan, "--add", "1", "--band", "0.1"],
        "render": ["render", scene, "--frames", "3", "--size", "16", "12", "--film", "apng"],
        "sweep": ["sweep", "reconstruct", scan, "--vary", "cutoff=0.5,1", "--fixed", "center=15.5"],
    }


def started(
    words: list[str],
    out: Path,
    *more: str,
    through: tuple[str, ...] = ("-m", "rift_cl.commands.cli"),
) -> subprocess.Popen[str]:
    """A command that was started, which writes into ``out``.

    Args:
        words: the command.
        out: its folder.
        *more: further words.
        through: what Python is told to run.
    """
    command = [sys.executable, *through, *words, "--out", str(out), "--quiet", *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def left_in(out: Path) -> dict[str, bytes]:
    """The files of a folder by their names in it, but for those that hold dates and times."""
    found = {path.relative_to(out).as_posix(): path for path in out.rglob("*") if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if path.name not in _DATED}


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
