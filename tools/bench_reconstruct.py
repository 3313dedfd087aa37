"""``rift reconstruct`` from a file of counts to slices: processor time, and beside another version.

    python tools/bench_reconstruct.py --json reconstruct.json
    python tools/bench_reconstruct.py --against ../old-checkout --json reconstruct.json

The scan is made first: an analytic head inside a larger ellipse with an axis off the middle, as
counts of photons with flats, darks and a few detector columns of a gain of their own. Each run is
a process of its own, in turns, so that the import, the search for the axis, the removal of rings,
the report and the disk are all part of it; kernels are built in a first run that does not count.
The other version is a checkout of this repository, whose command is run with the same options.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import h5py
import numpy as np
import tyro

import rift_cl as rift
from bench.surroundings import surroundings
from rift_cl.cl import default_device
from rift_cl.commands.console_table import print_table
from rift_cl.phantom import project

_HERE = Path(__file__).resolve().parents[1]
# Photons without the sample, the greatest line integral, and the share of columns with a gain.
_PHOTONS, _GREATEST, _STRIPES = 30_000.0, 1.6, 0.05
_FRAMES = 10


@dataclass(frozen=True)
class Options:
    """Measure whole runs.

    Args:
        json: file for every figure.
        against: checkout of another version.
        rows: slices.
        views: over 180 degrees.
        bins: of the detector.
        center: bin of the axis.
        rounds: how often each version has its turn.
        arguments: further options of both commands.
        seed: of the photons and the stripes.
    """

    json: Path
    against: Path | None = None
    rows: int = 32
    views: int = 1500
    bins: int = 1024
    center: float = 530.25
    rounds: int = 3
    arguments: tuple[str, ...] = field(default_factory=tuple)
    seed: int = 0


def main() -> None:
    """Make the scan, let the versions take turns, print and keep the figures."""
    options = tyro.cli(Options, description=__doc__)
    with tempfile.TemporaryDirectory() as folder:
        scan = Path(folder, "scan.h5")
        write_scan(scan, options)
        checkouts = {"this version": _HERE}
        if options.against is not None:
            checkouts["the other"] = options.against.resolve()
        runs: dict[str, list[dict[str, float]]] = {name: [] for name in checkouts}
        for turn in range(options.rounds + 1):
            for name, checkout in checkouts.items():
                figures = run(checkout, scan, Path(folder, name), options.arguments)
                if turn:
                    runs[name].append(figures)
    print_table(("version", "processor s", "wall s", "axis off by"), _lines(runs, options))
    record = {
        "surroundings": surroundings(default_device()),
        "options": {name: str(value) for name, value in vars(options).items()},
        "runs": runs,
    }
    options.json.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


def write_scan(path: Path, options: Options) -> None:
    """Write the counts as a Data Exchange file."""
    chance = np.random.default_rng(options.seed)
    angles = np.arange(options.views) * np.pi / options.views
    grid = rift.Grid((options.rows, options.bins, options.bins))
    scan = rift.Parallel(angles, options.bins, center=options.center)
    integrals = project(rift.phantom.head(grid), grid, scan)
    integrals *= _GREATEST / integrals.max()
    beam = _PHOTONS * chance.uniform(0.8, 1.2, (options.rows, options.bins))
    striped = chance.random((options.rows, options.bins)) < _STRIPES
    gain = np.where(striped, chance.normal(1, 0.01, striped.shape), 1)
    with h5py.File(path, "w") as file:
        counts = chance.poisson(beam * gain * np.exp(-integrals))
        file["exchange/data"] = np.minimum(counts, 65535).astype(np.uint16)
        flats = chance.poisson(np.broadcast_to(beam, (_FRAMES, *beam.shape)))
        file["exchange/data_white"] = flats.astype(np.uint16)
        file["exchange/data_dark"] = np.zeros((_FRAMES, *beam.shape), np.uint16)
        file["exchange/theta"] = np.rad2deg(angles)


def run(checkout: Path, scan: Path, out: Path, arguments: tuple[str, ...]) -> dict[str, float]:
    """Reconstruct with one version.

    Returns:
        Seconds of the processor and on the clock, and the axis that was used.
    """
    command = [
        sys.executable,
        "-m",
        "rift_cl.commands.cli",
        "reconstruct",
        str(scan),
        "--out",
        str(out),
    ]
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [*command, "--overwrite", "--quiet", *arguments],
        env=environment,
        cwd=checkout,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    metrics: dict[str, Any] = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {"processor": seconds, "wall": metrics["seconds"], "center": metrics["center"]}


def _lines(runs: dict[str, list[dict[str, float]]], options: Options) -> list[tuple[str, ...]]:
    lines = []
    for name, figures in runs.items():
        processor, wall = (median(f[kind] for f in figures) for kind in ("processor", "wall"))
        off = figures[0]["center"] - options.center
        lines.append((name, f"{processor:.2f}", f"{wall:.2f}", f"{off:+.3f}"))
    if len(runs) == 2:
        first, second = (median(f["processor"] for f in figures) for figures in runs.values())
        lines.append(("this / the other", f"{first / second:.3f}", "", ""))
    return lines


if __name__ == "__main__":
    main()
