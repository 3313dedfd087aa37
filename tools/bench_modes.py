"""What Hermite modes cost: the time of a (splat, pixel) pair relative to a plain Gaussian's.

    python tools/bench_modes.py --json modes.json

All kinds draw the same splats over the same rectangles from the same tile lists, in one process
and in turns, so that what differs is the work of a pair. Times are those of the processor where
the device is a CPU, which other programs on the machine disturb least. Modes that reach farther
than a Gaussian meet more pairs; that shows in ``pairs per pixel`` of tools/compare_bases.py.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro

import rift_cl as rift
from bench.command import report, say
from bench.splats import SplatCase
from bench.surroundings import surroundings
from bench.tables import Table
from rift_cl.basis import n_coeff
from rift_cl.splat import ScreenModes, ScreenSplats, SplatSettings, raster_grad, rasterize

_GAUSSIAN = "Gaussian"
# Orders of the shape's and of the colours' polynomials.
_KINDS = {
    "shape, order 0": (0, 0),
    "shape, order 1": (1, 0),
    "shape, order 2": (2, 0),
    "shape, order 3": (3, 0),
    "shape, order 4": (4, 0),
    "RGB, order 1": (0, 1),
    "RGB, order 2": (0, 2),
    "RGB, order 3": (0, 3),
    "shape and RGB, order 1": (1, 1),
    "shape and RGB, order 2": (2, 2),
}


@dataclass(frozen=True)
class Options:
    """Measure the rasters.

    Args:
        json: file for every figure.
        splats: how many.
        size: pixels along an edge.
        widen: by how much splats are larger than those of the other benchmarks; many pixels of
            each make the pairs decide.
        modes: of the rasterizer, and the activation.
        rounds: how often each kind has its turn; the shortest time counts.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    json: Path
    splats: int = 2000
    size: int = 256
    widen: float = 3.0
    modes: tuple[str, ...] = ("light:clamp", "light:exp", "light:square", "xray:clamp")
    rounds: int = 15
    device: str | None = None


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """Run the benchmark, mode by mode; the record of all that was measured so far."""
    device = rift.open_device(options.device)
    head, cases = surroundings(device), list[dict[str, Any]]()
    for mode in options.modes:
        say(mode)
        name, activation = mode.split(":")
        settings: Any = {"mode": name, "activation": activation}
        cases.append({"mode": mode, **_case(device, options, SplatSettings(**settings))})
        yield {**head, "cases": cases}


def _case(device: rift.Device, options: Options, settings: SplatSettings) -> dict[str, Any]:
    case = SplatCase(options.splats, options.size, device)
    splats = replace(case.splats, scales=device.array(options.widen * case.parameters["scales"]))
    plain = SplatSettings(mode=settings.mode)
    frame = rift.Renderer(plain, device=device).forward(splats, case.camera)
    screen = ScreenSplats(frame.projection.screen, frame.raster_pass.screen.features)
    kinds = {_GAUSSIAN: (screen, plain)}
    for name, orders in _KINDS.items():
        modes = _modes(device, device.get(screen.screen), *orders)
        kinds[name] = (replace(screen, modes=modes), settings)
    found = _times(device, kinds, frame, device.array(case.grad_image), options.rounds)
    return {"entries": frame.lists.n_entries, "seconds": found}


def _modes(device: rift.Device, screen: Any, shape: int, color: int) -> ScreenModes:
    """Small polynomials of the splats, whose places are whitened by their conics."""
    a, b, c = np.maximum(screen[:, 2:5].T.astype(float), [[1e-12], [-np.inf], [1e-12]])
    across = np.sqrt(np.maximum(a - b * b / c, 1e-12))
    count = n_coeff(shape, 2) - 1 + 3 * (n_coeff(color, 2) - 1)
    numbers = 0.03 * np.random.default_rng(0).normal(size=(len(screen), count))
    table = np.column_stack([across, b / np.sqrt(c), np.sqrt(c), numbers])
    return ScreenModes(device.array(table.astype(np.float32)), shape, color, 3 if color else 0)


def _times(
    device: rift.Device, kinds: dict[str, Any], frame: Any, grad: Any, rounds: int
) -> dict[str, dict[str, float]]:
    clock = time.process_time if device.traits.is_cpu else time.perf_counter
    size, lists = frame.camera.size, frame.lists
    best = {name: {"forward": np.inf, "gradient": np.inf} for name in kinds}
    for turn in range(rounds + 1):
        for name, (splats, settings) in kinds.items():
            began = clock()
            raster = rasterize(device, splats, lists, size, settings=settings)
            device.finish()
            middle = clock()
            raster_grad(device, splats, lists, raster, grad, settings=settings)
            device.finish()
            # The first turn builds the kernels.
            if turn:
                for way, took in (("forward", middle - began), ("gradient", clock() - middle)):
                    best[name][way] = min(best[name][way], took)
    return best


def _tables(record: dict[str, Any]) -> Iterator[Table]:
    for case in record["cases"]:
        first, rows = case["seconds"][_GAUSSIAN], []
        for name, found in case["seconds"].items():
            ways = [f"{found[way] / first[way]:.2f}" for way in ("forward", "gradient")]
            both = sum(found.values()) / sum(first.values())
            rows.append([name, *ways, f"{both:.2f}"])
        heads = ["polynomials", "forward", "gradient", "both"]
        yield Table(f"Time of a pair, in Gaussians: {case['mode']}", heads, rows)


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    return report(
        "bench_modes",
        measure_all(options),
        json_file=options.json,
        markdown_file=None,
        page=lambda record: "",
        tables=_tables,
    )


if __name__ == "__main__":
    sys.exit(main())
