"""Times the projector of fans beside ASTRA's strips on a CPU and says how true both are.

    python tools/bench_fan.py --size 256 --views 360

Forward and back of one slice, a full turn, source at three edges of the grid, magnification 1.5, in
one process. The runs alternate, so that what else the machine does meets both; the least wall time
and the least processor time of each is printed. ASTRA's CPU code runs on one thread, ours on all.
Errors are those of the projected head against its line integrals, in the norm.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

import rift_cl as rift


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=256, help="edge of the image in pixels")
    parser.add_argument("--views", type=int, default=360, help="number of views")
    parser.add_argument(
        "--runs", type=int, default=7, help="runs of each, of which the best counts"
    )
    given = parser.parse_args()
    if find_spec("astra") is None:
        parser.error("ASTRA, the peer, is not installed: pip install astra-toolbox")
    grid, scan = rift.Grid((given.size, given.size)), turn(given.size, given.views)
    head = rift.phantom.shepp_logan(grid)
    truth = rift.phantom.shepp_logan_sinogram(grid, scan)
    A, peer = rift.Projector(grid, scan), Peer(grid, scan)
    y = A(head)
    print(f"{A.device.name}: {given.size} x {given.size}, {given.views} views")
    errors = error(y, truth), error(peer.project(head), truth)
    print(f"error of the projected head: RiFT-CL {errors[0]:.4f}, ASTRA {errors[1]:.4f}")
    updates = given.size**2 * given.views
    for name, ours, theirs in (
        ("forward", lambda: A(head), lambda: peer.project(head)),
        ("back", lambda: A.T(y), lambda: peer.backproject(y)),
    ):
        (wall, cpu), (peer_wall, peer_cpu) = least([ours, theirs], given.runs)
        rate = updates / wall / 1e9
        ours_took, peer_took = wall * 1e3, peer_wall * 1e3
        print(f"{name}: {ours_took:.1f} ms, {rate:.2f} Gupdate/s; ASTRA {peer_took:.1f} ms")
        print(f"  processors {cpu * 1e3:.1f} and {peer_cpu * 1e3:.1f} ms")
        print(
            f"  {peer_wall / wall:.1f} times by the clock, {peer_cpu / cpu:.1f} by processors' time"
        )


def turn(size: int, views: int) -> rift.Fan:
    """A full turn whose detector just sees the circle in the grid."""
    distance, reach = 3.0 * size, 4.5 * size
    pitch = 1.02 * 2 * reach * np.tan(np.arcsin(0.5 / 3)) / size
    return rift.Fan(2 * np.pi * np.arange(views) / views, size, pitch, distance, reach)


def error(y: Any, truth: Any) -> float:
    """Relative error in the norm."""
    return float(np.linalg.norm(y - truth) / np.linalg.norm(truth))


def least(calls: list[Callable[[], Any]], runs: int) -> list[tuple[float, float]]:
    """Least wall time and processor time of each call, in seconds."""
    found = [(np.inf, np.inf)] * len(calls)
    for _ in range(runs):
        for n, call in enumerate(calls):
            wall, cpu = time.perf_counter(), time.process_time()
            call()
            spent = time.perf_counter() - wall, time.process_time() - cpu
            found[n] = min(found[n][0], spent[0]), min(found[n][1], spent[1])
    return found


class Peer:
    """ASTRA's projector ``strip_fanflat``, whose y axis points the other way."""

    def __init__(self, grid: rift.Grid, scan: rift.Fan) -> None:
        import astra

        self._astra = astra
        height, width = grid.shape
        volume = astra.create_vol_geom(height, width)
        behind = scan.source_to_detector - scan.source_to_axis
        views = astra.create_proj_geom(
            "fanflat", scan.pitch, scan.bins, scan.angles, scan.source_to_axis, behind
        )
        self._projector = astra.create_projector("strip_fanflat", views, volume)
        self._image = astra.data2d.create("-vol", volume)
        self._sinogram = astra.data2d.create("-sino", views)
        self._forward = self._algorithm("FP", "VolumeDataId")
        self._back = self._algorithm("BP", "ReconstructionDataId")

    def _algorithm(self, name: str, image: str) -> int:
        settings = self._astra.astra_dict(name)
        settings["ProjectorId"] = self._projector
        settings["ProjectionDataId"], settings[image] = self._sinogram, self._image
        return int(self._astra.algorithm.create(settings))

    def project(self, image: Any) -> Any:
        """The sinogram of an image."""
        self._astra.data2d.store(self._image, np.ascontiguousarray(image[::-1]))
        self._astra.algorithm.run(self._forward)
        return self._astra.data2d.get(self._sinogram)

    def backproject(self, sinogram: Any) -> Any:
        """The image of a sinogram."""
        self._astra.data2d.store(self._sinogram, sinogram)
        self._astra.algorithm.run(self._back)
        return self._astra.data2d.get(self._image)[::-1]


if __name__ == "__main__":
    main()
