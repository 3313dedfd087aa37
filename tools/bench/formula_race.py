"""Filtered backprojection by each projector, in turns: processor time of a slice, and quality."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import rift_cl as rift
from bench.checkout import Checkout
from bench.tables import Table
from rift_cl.metrics import psnr
from rift_cl.operators import cheapest_projector
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram

# Standard deviation of the noise, as a share of the greatest line integral.
_NOISE = 0.01
# Slices are worth their turns: a round of large ones takes seconds.
_LEAST_ROUNDS = 3
# Imported while a version has its turn, by its name.
_FORMULA = "rift_cl.reconstruct.direct.filtered_backprojection"


class _Contender(NamedTuple):
    """Something that reconstructs.

    Args:
        turn: what holds while it works.
        run: takes the slices that are measured once, and waits for them.
        image: of a sinogram on the host.
    """

    turn: Callable[[], AbstractContextManager[Any]]
    run: Callable[[], None]
    image: Callable[[NDArray[np.float32]], NDArray[np.float32]]


def formula_case(device: rift.Device, n: int, options: Any) -> dict[str, Any]:
    """Times and qualities at a size: as many views and bins as pixels along an edge."""
    angles = np.linspace(0, np.pi, n, endpoint=False)
    times: dict[str, dict[str, list[float]]] = {}
    quality: dict[str, Any] = {}
    for slices in sorted({1, options.slices}):
        found = dict(_contenders(device, n, angles, slices, options.against))
        rounds = max(_LEAST_ROUNDS, options.rounds * 512 // n)
        times[str(slices)] = _times(found, slices, rounds)
        if slices == 1 and options.accuracy:
            quality = _quality(found, n, angles, options.seed)
    return {"size": n, "cpu_s": times, "psnr_db": quality}


def _contenders(
    device: rift.Device, n: int, angles: Any, slices: int, against: Any
) -> Iterator[tuple[str, _Contender]]:
    shape = (n, n) if slices == 1 else (slices, n, n)
    here = [
        ("direct", rift.Projector),
        ("fast", rift.FastProjector),
        ("cheapest", cheapest_projector),
    ]
    for name, make in here:
        yield name, _contender(rift, device, make, shape, angles, nullcontext)
    if against is not None:
        other = Checkout(against)
        with other.active() as package:
            theirs = package.open_device(device.selector)
            make = package.FastProjector
            yield "fast, other", _contender(package, theirs, make, shape, angles, other.active)


def _contender(
    package: Any, device: Any, make: Any, shape: Any, angles: Any, turn: Any
) -> _Contender:
    grid, scan = package.Grid(shape), package.Parallel(angles, shape[-1])
    A = make(grid, scan, device=device)
    operator = import_module(_FORMULA).FilteredBackprojection(A)
    random = np.random.default_rng(0)
    y = device.array(random.standard_normal(A.range).astype(np.float32))
    x = device.empty(A.domain)

    def run() -> None:
        operator(y, x)
        device.finish()

    return _Contender(turn, run, operator)


def _times(found: dict[str, _Contender], slices: int, rounds: int) -> dict[str, list[float]]:
    seconds: dict[str, list[float]] = {name: [] for name in found}
    for turn in range(rounds + 1):
        for name, contender in found.items():
            with contender.turn():
                began = time.process_time()
                contender.run()
                spent = time.process_time() - began
            if turn:
                seconds[name].append(spent / slices)
    return seconds


def _quality(
    found: dict[str, _Contender], n: int, angles: Any, seed: int
) -> dict[str, dict[str, float]]:
    grid, scan = rift.Grid((n, n)), rift.Parallel(angles, n)
    truth, clean = shepp_logan(grid), shepp_logan_sinogram(grid, scan)
    noise = np.random.default_rng(seed).standard_normal(clean.shape)
    data = {"analytic": clean, "noisy": clean + (_NOISE * clean.max() * noise).astype(np.float32)}
    scored: dict[str, dict[str, float]] = {}
    for name, contender in found.items():
        with contender.turn():
            images = {kind: contender.image(views) for kind, views in data.items()}
        scored[name] = {kind: psnr(image, truth) for kind, image in images.items()}
    return scored


def formula_tables(cases: list[dict[str, Any]]) -> Iterator[Table]:
    """Milliseconds of a processor for each slice, and how many times less than the others."""
    rows = []
    for case in cases:
        for slices, runs in case["cpu_s"].items():
            least = {name: min(seconds) for name, seconds in runs.items()}
            for name, spent in least.items():
                ratios = [f"{least['direct'] / spent:.2f}"]
                other = least.get("fast, other")
                ratios.append("" if other is None else f"{other / spent:.2f}")
                scores = case["psnr_db"].get(name, {}) if slices == "1" else {}
                quality = [f"{scores[kind]:.2f}" if scores else "" for kind in _DATA]
                cells = [str(case["size"]), slices, name, f"{1000 * spent:.2f}"]
                rows.append([*cells, *ratios, *quality])
    heads = ["size", "slices", "projector", "ms", "times direct", "times other", *_DATA]
    yield Table("Filtered backprojection, processor time of a slice", heads, rows)


_DATA = ("analytic", "noisy")
