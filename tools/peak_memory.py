"""How much memory ``rift reconstruct`` takes, beside what it plans with: a row for each method.

    python tools/peak_memory.py --bins 1024 --views 256 --rows 32 --cone 160

Each method reconstructs a phantom of parallel beams and one of cone beams in a process of its own,
on a CPU device, whose memory is the process's. It does so twice, so that kernels and libraries are
loaded; counted is what the process holds more than after the first time, at its peak (VmHWM of
Linux). Planned is what the memory budget is divided by: the arrays of a slab, on host and device
together, and the projector's own.
"""

from __future__ import annotations

import ctypes
import gc
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import tyro

METHODS: dict[str, dict[str, Any]] = {
    "fbp": {},
    "backproject": {},
    "sirt": {"steps": 2},
    "cgls": {"steps": 2},
    "tv": {"steps": 2, "weight": 0.01},
}
_FROM, _TO = "import peak_memory as p, sys; p.serve(sys.argv[1], sys.argv[2], sys.argv[3])", 2**20


@dataclass(frozen=True)
class Options:
    """Measure the peaks of all methods.

    Args:
        bins: of the parallel scan.
        views: of it.
        rows: of it.
        cone: views, rows and bins of the cone-beam scan.
        only: methods to run; all if not given.
    """

    bins: int = 1024
    views: int = 256
    rows: int = 32
    cone: int = 160
    only: tuple[str, ...] = tuple(METHODS)


def main(options: Options) -> None:
    """Print the table."""
    print("| scan | method | planned, MiB | peak, MiB | peak / planned |")
    print("| :-- | :-- | --: | --: | --: |")
    with tempfile.TemporaryDirectory(prefix="rift-cl-peak-") as folder:
        for scan in (_slices(Path(folder), options), _cone(Path(folder), options.cone)):
            for method in options.only:
                out = Path(folder, f"{scan.stem}-{method}")
                planned, peak = _measured(scan, method, out)
                figures = f"{planned / _TO:.0f} | {peak / _TO:.0f} | {peak / planned:.2f}"
                print(f"| {scan.stem} | {method} | {figures} |", flush=True)


def _slices(folder: Path, options: Options) -> Path:
    shape = options.views, options.rows, options.bins
    return _saved(folder / "parallel.h5", shape, np.pi, {})


def _cone(folder: Path, size: int) -> Path:
    lengths = {"source_to_axis": 4.0 * size, "source_to_detector": 8.0 * size, "pitch": 2.0}
    return _saved(folder / "cone.npz", (size, size, size), 2 * np.pi, lengths)


def _saved(path: Path, shape: tuple[int, int, int], turn: float, lengths: dict[str, Any]) -> Path:
    """A ball; what it looks like changes no size."""
    views, rows, bins = shape
    z, x = np.arange(rows)[:, None] - (rows - 1) / 2, np.arange(bins) - (bins - 1) / 2
    one = np.sqrt(np.maximum((0.4 * min(rows, bins)) ** 2 - x**2 - z**2, 0)) / bins
    angles = np.arange(views) * turn / views
    projections = np.repeat(one[None].astype(np.float32), views, 0)
    if path.suffix == ".npz":
        np.savez(path, projections=projections, angles=angles, **lengths)
        return path
    with h5py.File(path, "w") as file:
        file["exchange/data"] = projections
        file["exchange/theta"] = np.rad2deg(angles)
    return path


def _measured(scan: Path, method: str, out: Path) -> tuple[int, int]:
    """Bytes that are planned with, and bytes at the peak."""
    here = Path(__file__).absolute().parent
    words = [sys.executable, "-c", _FROM, str(scan), method, str(out)]
    done = subprocess.run(words, cwd=here, stdout=subprocess.PIPE, text=True, check=True)
    planned, peak = json.loads(done.stdout.splitlines()[-1])
    return planned, peak


def serve(scan: str, method: str, out: str) -> None:
    """Reconstruct in this process, and print both numbers of bytes."""
    from rift_cl.commands.reconstruct.choice import reconstruction_of
    from rift_cl.commands.reconstruct.settings import ReconstructSettings
    from rift_cl.io import open_scan

    _, rows, bins = open_scan(scan, values=False).shape
    given = {"kind": "attenuation", "center": (bins - 1) / 2, "method": method, **METHODS[method]}
    given |= {"footprint": "strip", "format": "h5"}
    first = ReconstructSettings(Path(scan), out=Path(out + "-1"), **given)
    for _ in reconstruction_of(first).run():
        pass
    job = reconstruction_of(ReconstructSettings(Path(scan), out=Path(out), **given))
    gc.collect()
    job.device.release()
    # What was freed and is kept by the C library would be missing from the peak.
    ctypes.CDLL(None).malloc_trim(0)
    before = _status("VmRSS")
    # The peak from now on.
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    for _ in job.run():
        pass
    print(json.dumps([_planned(job, rows), _status("VmHWM") - before]))


def _planned(job: Any, rows: int) -> int:
    """What the budget is divided by, for the largest slab."""
    if not hasattr(job.inversion, "slabs"):
        return int(job.source._need)
    slabs = job.inversion.slabs([slice(0, rows)])
    most = max(slab.stop - slab.start for slab in slabs)
    return int(job.inversion.need * most + job.inversion.fixed(most))


def _status(name: str) -> int:
    """A size of this process in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))


if __name__ == "__main__":
    main(tyro.cli(Options))
