"""Cones: filtered backprojection, both halves of the pair and CGLS, beside RTK in one process.

    python tools/bench_cone.py
    python tools/bench_cone.py --sizes 256x360 512x360 --rounds 1

An update is a voxel in a view; a projection needs 4 flop for it, of which the share of the device's
multiply-add rate is told. Seconds are the best of the rounds, by the clock and by the processor
time of all threads, which tells more where the machine has other work; so are the times that RTK
takes as long. PSNR is that of the head inside the ball that the detector sees. RTK takes part where
it is installed: ``pip install itk-rtk``. It is told what runs and how long it took, since RTK needs
minutes for a part at 512x360; a part that finds too little free memory is left out with a sentence.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
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
from rift_cl.cl.budget import format_bytes, free_host_memory

_HEAD = ("operation", "who", "seconds", "CPU seconds", "Gup/s", "share of multiply-adds", "PSNR")
_STEPS, _FLOP = 10, 4
_OURS, _PEER = "ours", "RTK"
# Volumes and sets of projections that a part holds at most, of float32.
_HELD = 8
# What RTK loads its modules with.
_SMALL = ConeCase(16, 8)


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


@dataclass(frozen=True)
class Part:
    """An operation that is timed.

    Args:
        who: does it.
        name: of the operation.
        run: does it once.
        prepare: does as much of it as builds kernels or loads modules.
        updates: voxels in views that it takes.
        scored: whether the result is the head.
    """

    who: str
    name: str
    run: Callable[[], Any]
    prepare: Callable[[], Any]
    updates: float
    scored: bool = False


@dataclass(frozen=True)
class Timed:
    """The best of a part's rounds: seconds by the clock, by the processors, and how true it is."""

    part: Part
    seconds: float
    processor: float
    psnr: float | None

    def row(self, limit: float) -> tuple[str, ...]:
        """Of the table, given the device's multiply-add rate."""
        rate, quality = self.part.updates / self.seconds, self.psnr
        return (
            self.part.name,
            self.part.who,
            f"{self.seconds:.3f}",
            f"{self.processor:.3f}",
            f"{rate / 1e9:.2f}",
            f"{_FLOP * rate / limit:.0%}",
            "" if quality is None else f"{quality:.2f}",
        )


def main(options: Options) -> int:
    """Measure, and print a table for each size."""
    device = rift.open_device(options.device)
    meter = LimitMeter(device)
    meter.measure()
    for size in options.sizes:
        n, views = (int(number) for number in size.split("x"))
        case = ConeCase(n, views)
        say(case.name)
        timed = list(_timed(device, case, options.rounds))
        rows = [found.row(meter.best().multiply_add) for found in timed]
        show([Table(case.name, _HEAD, rows, list(_ratios(timed)))])
    return 0


def _timed(device: rift.Device, case: ConeCase, rounds: int) -> Iterator[Timed]:
    truth = phantom.shepp_logan(case.grid)
    seen = phantom.project(phantom.head(case.grid), case.grid, case.scan)
    for part in _parts(device, case, truth, seen):
        needed, free = 4 * _HELD * (case.samples + case.pixels), free_host_memory()
        if free is not None and needed > free:
            missing = f"needs {format_bytes(needed)} of memory, {format_bytes(free)} are free"
            say(f"  {part.name}, {part.who}: left out, {missing}")
            continue
        part.prepare()
        found = _best(part, truth, rounds)
        took = f"{found.seconds:.2f} s, {found.processor:.2f} s of processors"
        quality = "" if found.psnr is None else f", {found.psnr:.2f} dB"
        say(f"  {part.name}, {part.who}: {took}{quality}")
        yield found


def _parts(device: rift.Device, case: ConeCase, truth: Any, seen: Any) -> list[Part]:
    """What RTK does as well comes first: the steps of CGLS take longest and have no peer."""
    *both, steps = _ours(device, case, truth, seen)
    return [*both, *_peer(case, truth, seen), steps]


def _best(part: Part, truth: Any, rounds: int) -> Timed:
    """The part's least times."""
    times, result = [], None
    for _ in range(rounds):
        wall, processor = time.perf_counter(), time.process_time()
        result = part.run()
        times.append((time.perf_counter() - wall, time.process_time() - processor))
    seconds, processor = (min(column) for column in zip(*times, strict=True))
    return Timed(
        part, seconds, processor, ball_psnr(np.asarray(result), truth) if part.scored else None
    )


def _ratios(timed: list[Timed]) -> Iterator[str]:
    """How much longer RTK takes for what both do, a sentence each."""
    ours, peer = (
        {found.part.name: found for found in timed if found.part.who == who}
        for who in (_OURS, _PEER)
    )
    for name in (name for name in ours if name in peer):
        a, b = ours[name], peer[name]
        times = b.seconds / a.seconds, b.processor / a.processor
        yield f"{name}: {times[0]:.1f} times by the clock, {times[1]:.1f} by processors' time"


def _ours(device: rift.Device, case: ConeCase, truth: Any, seen: Any) -> Iterator[Part]:
    A = rift.Projector(case.grid, case.scan, device=device)
    x, y = device.array(truth), device.array(seen)
    data, volume = device.empty(A.range), device.empty(A.domain)
    inversion = rift.reconstruct.FDK(A)

    def finished(operator: Any, given: Any, out: Any) -> Any:
        operator(given, out)
        device.finish()

    once = case.updates
    for name, run, scored in (
        ("filtered backprojection", lambda: inversion(seen), True),
        ("forward", lambda: finished(A, x, data), False),
        ("backward", lambda: finished(A.T, y, volume), False),
    ):
        yield Part(_OURS, name, run, run, once, scored)
    yield Part(
        _OURS,
        f"{_STEPS} steps of CGLS",
        lambda: rift.cgls(A, seen, _STEPS),
        lambda: rift.cgls(A, seen, 1),
        (2 * _STEPS + 1) * once,
        scored=True,
    )


def _peer(case: ConeCase, truth: Any, seen: Any) -> Iterator[Part]:
    try:
        peer, small = Rtk(case.grid, case.scan), Rtk(_SMALL.grid, _SMALL.scan)
    except ImportError:
        say("RTK is not installed: pip install itk-rtk")
        return
    scan = _SMALL.scan
    little = np.zeros(_SMALL.grid.shape, np.float32)
    few = np.zeros((scan.views, scan.rows, scan.bins), np.float32)
    once = case.updates
    for name, work, given, first, scored in (
        ("filtered backprojection", Rtk.filtered, seen, few, True),
        ("forward", Rtk.projected, truth, little, False),
        ("backward", Rtk.backprojected, seen, few, False),
    ):
        run, prepare = partial(work, peer, given), partial(work, small, first)
        yield Part(_PEER, name, run, prepare, once, scored)


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
