"""Cones: filtered backprojection, both halves of the pair and CGLS, beside RTK in one process.

    python tools/bench_cone.py
    python tools/bench_cone.py --sizes 256x360 512x360 --rounds 1

An update is a voxel in a view; a projection needs 4 flop for it, of which the share of the device's
multiply-add rate is told. Seconds are the best of the rounds, by the clock and by the processor
time of all threads, which tells more where the machine has other work. PSNR is that of the head
inside the ball that the detector sees. RTK takes part where it is installed: ``pip install
itk-rtk``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro

import rift_cl as rift
from bench.ball_psnr import ball_psnr
from bench.command import say
from bench.cones import ConeCase
from bench.limits import LimitMeter
from bench.rtk import Rtk
from bench.table import Table, show
from rift_cl import phantom

_HEAD = ("operation", "who", "seconds", "CPU seconds", "Gup/s", "share of multiply-adds", "PSNR")
_STEPS, _FLOP = 10, 4


@dataclass(frozen=True)
class Options:
    """Measure cones.

    Args:
        sizes: VOXELSxVIEWS, any number of them: voxels along a side of the volume.
        rounds: how often each operation is done.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    sizes: tuple[str, ...] = ("128x180",)
    rounds: int = 3
    device: str | None = None


def main(options: Options) -> int:
    """Measure, and print a table for each size."""
    device = rift.open_device(options.device)
    meter = LimitMeter(device)
    meter.measure()
    for size in options.sizes:
        n, views = (int(number) for number in size.split("x"))
        case = ConeCase(n, views)
        say(case.name)
        rows = list(_rows(device, case, options.rounds, meter.best().multiply_add))
        show([Table(case.name, _HEAD, rows)])
    return 0


def _rows(
    device: rift.Device, case: ConeCase, rounds: int, limit: float
) -> Iterator[tuple[str, ...]]:
    truth = phantom.shepp_logan(case.grid)
    seen = phantom.project(phantom.head(case.grid), case.grid, case.scan)
    for who, name, run, updates, scored in _operations(device, case, truth, seen):
        run()
        times, result = [], None
        for _ in range(rounds):
            wall, processor = time.perf_counter(), time.process_time()
            result = run()
            times.append((time.perf_counter() - wall, time.process_time() - processor))
        seconds, processor = (min(column) for column in zip(*times, strict=True))
        share = _FLOP * updates / seconds / limit
        quality = f"{ball_psnr(np.asarray(result), truth):.2f}" if scored else ""
        rate = f"{updates / seconds / 1e9:.2f}"
        yield (name, who, f"{seconds:.3f}", f"{processor:.3f}", rate, f"{share:.0%}", quality)


def _operations(
    device: rift.Device, case: ConeCase, truth: Any, seen: Any
) -> Iterator[tuple[str, str, Callable[[], Any], float, bool]]:
    """Who does what, how, with how many updates, and whether the result is the head."""
    A = rift.Projector(case.grid, case.scan, device=device)
    x, y = device.array(truth), device.array(seen)
    data, volume = device.empty(A.range), device.empty(A.domain)
    inversion = rift.reconstruct.FDK(A)

    def finished(operator: Any, given: Any, out: Any) -> Any:
        operator(given, out)
        device.finish()

    once = case.updates
    yield "ours", "filtered backprojection", lambda: inversion(seen), once, True
    yield "ours", "forward", lambda: finished(A, x, data), once, False
    yield "ours", "backward", lambda: finished(A.T, y, volume), once, False
    steps = f"{_STEPS} steps of CGLS"
    yield "ours", steps, lambda: rift.cgls(A, seen, _STEPS), (2 * _STEPS + 1) * once, True
    try:
        peer = Rtk(case.grid, case.scan)
    except ImportError:
        say("RTK is not installed: pip install itk-rtk")
        return
    yield "RTK", "filtered backprojection", lambda: peer.filtered(seen), once, True
    yield "RTK", "forward", lambda: peer.projected(truth), once, False
    yield "RTK", "backward", lambda: peer.backprojected(seen), once, False


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
