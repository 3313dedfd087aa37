"""The projector by the Fourier slice theorem against the one by phase tables: times and errors.

    python tools/bench_fast.py --json fast.json
    python tools/bench_fast.py --sizes 512 1024 2048 4096 --json fast.json
    python tools/bench_fast.py --sizes --fbp-sizes 512 1024 --against ../old --json fbp.json

Both run in one process, in turns, on the same arrays of the device. An error is the norm of a
difference over the norm of what it is measured against; `own limit` is the transform that the fast
projector approximates, computed by itself with an error of 1e-6 (which tests compare with a matrix
in float64).

Filtered backprojection is measured with as many views and bins as pixels along an edge, one slice
at a time and several: processor seconds of a slice (all threads), the least of the rounds, and the
reconstructions' PSNR from analytic line integrals and from noisy ones. The other version is a
checkout of this repository, whose projector has its turns in the same process.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import tyro

import rift_cl as rift
from bench.command import report, say
from bench.formula_race import formula_case, formula_tables
from bench.surroundings import surroundings
from bench.tables import Table
from rift_cl.metrics import psnr
from rift_cl.operators import FastProjector
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram
from rift_cl.reconstruct import FilteredBackprojection

_FINEST = 1e-6
# Bins per pixel of the image's edge, and views.
_BINS, _VIEWS = 1.4143, 1.5


@dataclass(frozen=True)
class Options:
    """Measure both projectors.

    Args:
        json: file for every figure and every raw time.
        sizes: pixels along an edge; there are 1.5 times as many views.
        fbp_sizes: pixels along an edge for filtered backprojection.
        slices: of its stack.
        against: checkout of another version, for filtered backprojection.
        kinds: ERROR:LOBES that the fast projector is asked for, any number of them.
        accuracy: also measure the errors, which takes most of the memory.
        rounds: how often each has its turn.
        device: which OpenCL device, as RIFT_DEVICE selects it.
        seed: of the white noise.
    """

    json: Path
    sizes: tuple[int, ...] = (512, 1024, 2048)
    fbp_sizes: tuple[int, ...] = (256, 512, 1024)
    slices: int = 4
    against: Path | None = None
    kinds: tuple[str, ...] = ("1e-3:0", "1e-2:1", "1e-3:1", "1e-4:1", "1e-3:2", "1e-3:3")
    accuracy: bool = True
    rounds: int = 7
    device: str | None = None
    seed: int = 0


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """Run the benchmark, size by size; the record of all that was measured so far."""
    device = rift.open_device(options.device)
    head, cases, formula = surroundings(device), list[dict[str, Any]](), list[dict[str, Any]]()
    head = {**head, "seed": options.seed}
    for size in options.fbp_sizes:
        say(f"filtered backprojection, {size} x {size}")
        formula.append(formula_case(device, size, options))
        yield {**head, "cases": cases, "fbp": formula}
    for size in options.sizes:
        say(f"{size} x {size}, {int(_VIEWS * size)} views")
        cases.append(_case(device, size, options))
        yield {**head, "cases": cases, "fbp": formula}


def _case(device: rift.Device, n: int, options: Options) -> dict[str, Any]:
    grid = rift.Grid((n, n))
    angles = np.linspace(0, np.pi, int(_VIEWS * n), endpoint=False)
    scan = rift.Parallel(angles, bins=int(_BINS * n) + 2)
    operators: dict[str, Any] = {"direct": rift.Projector(grid, scan, device=device)}
    setup = {}
    for kind in options.kinds:
        error, lobes = kind.split(":")
        began = time.perf_counter()
        fast = FastProjector(grid, scan, float(error), lobes=int(lobes), device=device)
        fast.prepare()
        device.finish()
        setup[kind] = time.perf_counter() - began
        operators[kind] = fast
    return {
        "size": n,
        "views": len(angles),
        "bins": scan.bins,
        "setup_s": setup,
        **_times(device, operators, options.rounds),
        "errors": _errors(operators, grid, scan, options.seed) if options.accuracy else {},
    }


def _times(device: rift.Device, operators: dict[str, Any], rounds: int) -> dict[str, Any]:
    first = operators["direct"]
    x, y = device.zeros(first.domain), device.zeros(first.range)
    seconds: dict[str, dict[str, list[float]]] = {"project": {}, "backproject": {}}
    for turn in range(rounds + 1):
        for name, A in operators.items():
            for way, run in (("project", A), ("backproject", A.T)):
                given, out = (x, y) if way == "project" else (y, x)
                device.finish()
                began = time.perf_counter()
                run(given, out)
                device.finish()
                if turn:
                    seconds[way].setdefault(name, []).append(time.perf_counter() - began)
    middle = {way: {k: median(v) for k, v in runs.items()} for way, runs in seconds.items()}
    ratios = {way: {k: runs["direct"] / v for k, v in runs.items()} for way, runs in middle.items()}
    return {"seconds": seconds, "median_s": middle, "times_faster": ratios}


def _errors(
    operators: dict[str, Any], grid: rift.Grid, scan: rift.Parallel, seed: int
) -> dict[str, Any]:
    direct = operators["direct"]
    phantom, sinogram = shepp_logan(grid), shepp_logan_sinogram(grid, scan)
    random = np.random.default_rng(seed)
    white = random.standard_normal(direct.range).astype(np.float32)
    found: dict[str, Any] = {}
    for data, views, filters in (
        ("Shepp-Logan, ram-lak", sinogram, "ram-lak"),
        ("Shepp-Logan, hann", sinogram, "hann"),
        ("Shepp-Logan, no filter", sinogram, None),
        ("white noise, no filter", white, None),
    ):
        images = {name: _image(A, views, filters) for name, A in operators.items()}
        found[data] = {
            name: {
                "to_own_limit": _off_limit(operators[name], image, views, filters),
                "to_direct": _relative(image, images["direct"]),
                "psnr_db": psnr(image, phantom) if filters else None,
            }
            for name, image in images.items()
        }
    projected = {name: A(phantom) for name, A in operators.items()}
    found["Shepp-Logan, projected"] = {
        name: {
            "to_own_limit": None,
            "to_direct": _relative(view, projected["direct"]),
            "to_analytic": _relative(view, sinogram),
        }
        for name, view in projected.items()
    }
    return found


def _off_limit(A: Any, image: Any, views: Any, filters: str | None) -> float | None:
    """How far a fast projector's image is from the one it approximates."""
    if not isinstance(A, FastProjector):
        return None
    exact = FastProjector(A.grid, A.scan, _FINEST, lobes=A.lobes, device=A.device)
    return _relative(image, _image(exact, views, filters))


def _image(A: Any, views: Any, filter: str | None) -> Any:
    return A.T(views) if filter is None else FilteredBackprojection(A, filter)(views)


def _relative(value: Any, truth: Any) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


def _tables(record: dict[str, Any]) -> Iterator[Table]:
    rows, accuracy = [], []
    for case in record["cases"]:
        for name in case["median_s"]["project"]:
            cells = [str(case["size"]), str(case["views"]), name]
            for way in ("project", "backproject"):
                cells.append(f"{case['median_s'][way][name]:.3f}")
                cells.append(f"{case['times_faster'][way][name]:.1f}")
            rows.append(cells)
        for data, entries in case["errors"].items():
            for name, entry in entries.items():
                quality, limit = entry.get("psnr_db"), entry["to_own_limit"]
                cells = ["" if limit is None else f"{limit:.1e}", f"{entry['to_direct']:.1e}"]
                cells.append("" if quality is None else f"{quality:.2f}")
                accuracy.append([str(case["size"]), data, name, *cells])
    timing = ["size", "views", "projector", "project, s", "times", "backproject, s", "times"]
    if rows:
        yield Table("Times", timing, rows)
    heads = ["size", "data", "projector", "to own limit", "to direct", "PSNR"]
    if accuracy:
        yield Table("Errors", heads, accuracy)
    yield from formula_tables(record.get("fbp", []))


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    return report(
        "bench_fast",
        measure_all(options),
        json_file=options.json,
        markdown_file=None,
        page=lambda record: "",
        tables=_tables,
    )


if __name__ == "__main__":
    sys.exit(main())
