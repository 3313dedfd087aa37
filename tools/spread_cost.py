"""What spreading work over processes costs: ``--cluster`` beside processes of their own.

    python tools/spread_cost.py                      # two workers, 256 slices of 512 x 512
    python tools/spread_cost.py --stub 10000         # the scheduler's memory over so many tasks

The first compares ``rift reconstruct --cluster local:N`` with N processes that know nothing of each
other and make one Nth of the slices each, every driver with one thread: seconds of the wall and of
the processor, runs in turn, the least of each. It also compares the slices, bit by bit. The second
gives tasks that only sleep to two workers and prints how the process that holds scheduler and
client grows. Run it on a machine that does nothing else.

Kernels are kept in a folder of the comparison, since each process checks all that are kept, and
the processor's seconds are of every process that a command began, those that outlive it too.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import zarr

import rift_cl as rift
from rift_cl.cluster.workers import Task, cluster_workers
from rift_cl.io import read_volume
from rift_cl.io.volumes import VOLUME_NAMES

_DRIVER = {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_CPU_MAX_CU_COUNT": "1"}
# Of Linux' prctl: a process whose parent ends becomes this process's child.
_SUBREAPER = 36
# Seconds that a task of the stub sleeps.
_NAP = 0.002


def save_scan(path: Path, slices: int, bins: int, views: int) -> None:
    """A phantom as a store of Zarr, row by row in chunks that a worker reads whole."""
    angles = np.arange(views) * np.pi / views
    row = rift.phantom.shepp_logan_sinogram(
        rift.Grid((bins, bins)), rift.Parallel(angles, bins)
    ).astype(np.float32)
    zarr.open_group(str(path), mode="w")
    given = {"shape": (views, slices, bins), "chunks": (views, 1, bins), "dtype": "f4"}
    data = zarr.open_array(str(path / "data"), mode="w", **given)
    for number in range(slices):
        data[:, number] = row * (1 + number / slices)
    given = {"shape": angles.shape, "chunks": angles.shape, "dtype": "f8"}
    zarr.open_array(str(path / "angles"), mode="w", **given)[:] = angles


def command(scan: Path, out: Path, bins: int, *options: str) -> list[str]:
    """A reconstruction in which nothing is looked for."""
    words = ["--dataset", "data", "--theta", "angles", "--kind", "attenuation", "--format", "zarr"]
    words += ["--center", str((bins - 1) / 2), "--pad", "off", "--rings", "off", "--overwrite"]
    return [sys.executable, "-m", "rift_cl", "reconstruct", str(scan), *words, "--out", str(out),
            "--quiet", *options]  # fmt: skip


def adopt_orphans() -> None:
    """Have this process wait for whatever its children leave behind; otherwise nobody counts it."""
    if ctypes.CDLL(None, use_errno=True).prctl(_SUBREAPER, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "cannot wait for processes of processes (Linux only)")


def await_orphans() -> None:
    """Wait until no process is left that a command began."""
    while True:
        try:
            os.wait()
        except ChildProcessError:
            return


def timed(commands: list[list[str]], cache: Path) -> tuple[float, float]:
    """Seconds of the wall and of the processor that commands side by side take.

    Args:
        commands: each the words of one.
        cache: where kernels are kept.
    """
    before, begin = os.times(), time.perf_counter()
    processes = [
        subprocess.Popen(
            words,
            env={**os.environ, **_DRIVER, "RIFT_CACHE_DIR": str(cache)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for words in commands
    ]
    statuses = [process.wait() for process in processes]
    if any(statuses):
        raise SystemExit("a reconstruction failed")
    wall = time.perf_counter() - begin
    await_orphans()
    after = os.times()
    spent = after.children_user + after.children_system
    return wall, spent - before.children_user - before.children_system


def compare(folder: Path, slices: int, bins: int, views: int, workers: int, runs: int) -> None:
    """Print the cost of a cluster."""
    scan = folder / "scan.zarr"
    save_scan(scan, slices, bins, views)
    edges = np.linspace(0, slices, workers + 1).astype(int)
    apart = [
        command(scan, folder / f"part{n}", bins, "--rows", str(edges[n]), str(edges[n + 1]))
        for n in range(workers)
    ]
    together = [command(scan, folder / "whole", bins, "--cluster", f"local:{workers}")]
    cache = folder / "cache"
    cache.mkdir()
    adopt_orphans()
    # Once to build the kernels.
    timed(apart, cache)
    timed(together, cache)
    found: dict[str, list[tuple[float, float]]] = {"apart": [], "cluster": []}
    for _ in range(runs):
        found["apart"].append(timed(apart, cache))
        found["cluster"].append(timed(together, cache))
    least = {name: np.min(times, axis=0) for name, times in found.items()}
    print(f"{slices} slices of {bins} x {bins}, {views} views, {workers} workers")
    for name, (wall, spent) in least.items():
        print(f"{name:<10} wall {wall:7.2f} s   processor {spent:7.2f} s")
    loss = 100 * (least["cluster"] / least["apart"] - 1)
    print(f"lost       wall {loss[0]:+7.1f} %   processor {loss[1]:+7.1f} %")
    store = VOLUME_NAMES["zarr"]
    parts = [read_volume(folder / f"part{n}" / store) for n in range(workers)]
    same = np.array_equal(np.concatenate(parts), read_volume(folder / "whole" / store))
    print("bits are the same" if same else "BITS DIFFER")


def resident() -> float:
    """Memory of this process in MB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def stub(tasks: int) -> None:
    """Print the memory of scheduler and client over tasks that only sleep."""
    every, begin = max(1, tasks // 10), time.perf_counter()
    with cluster_workers("local:2", rift.open_device(), None) as workers:
        naps = (Task(f"slab {n}", (_NAP,)) for n in range(tasks))
        done = 0
        for come in workers.each(time.sleep, naps):
            done += come is not None
            if come is not None and (done in (1, 100) or done % every == 0):
                spent = time.perf_counter() - begin
                print(f"{done:7d} tasks   {resident():7.1f} MB   {spent:6.1f} s", flush=True)


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--slices", type=int, default=256)
    parser.add_argument("--bins", type=int, default=512)
    parser.add_argument("--views", type=int, default=720)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--stub", type=int, default=0, help="tasks that only sleep")
    given = parser.parse_args()
    if given.stub:
        stub(given.stub)
        return
    folder = Path(tempfile.mkdtemp(prefix="rift-spread-"))
    try:
        compare(folder, given.slices, given.bins, given.views, given.workers, given.runs)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
