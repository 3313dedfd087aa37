"""The footprints beside each other: what they cost, how flat a disc is, how good pictures are.

    python tools/bench_footprints.py --json footprints.json --markdown footprints.md

Costs are processor time of the whole process. Footprints take turns, and the ratio to ``linear`` is
the median of the ratios within a turn, so that what else the machine does falls on all alike.
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
from bench.case import Case
from bench.command import report, say
from bench.surroundings import surroundings
from bench.table import Table, markdown_lines, milliseconds
from rift_cl import metrics, phantom
from rift_cl.operators import FOOTPRINTS
from rift_cl.reference import radon

_BASE = "linear"
_VIEWS = (180, 360)
# Samples are so many bins apart.
_SPACINGS = (0.5, 0.8, 1.0, 1.3, 2.0)
# The disc's radius as a share of the image's side, and the margin inside its edge, in bins.
_RADIUS, _MARGIN = 0.4, 6
_STEPS = 10


@dataclass(frozen=True)
class Options:
    """Measure every footprint.

    Args:
        json: file for every figure and every raw time.
        markdown: file for the tables.
        cost: PIXELSxVIEWS at which costs are measured.
        size: pixels along a side of the head, and of the disc's image where they are no wider than
            bins; where they are, the image has no more bins across.
        views: of the head.
        rounds: how often each has its turn.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    json: Path
    markdown: Path | None = None
    cost: str = "512x768"
    size: int = 256
    views: tuple[int, ...] = (96, 384)
    rounds: int = 25
    device: str | None = None


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """What was measured so far, part by part."""
    device, case = rift.open_device(options.device), Case.parse(options.cost)
    record: dict[str, Any] = {**surroundings(device), "size": options.size, "cost": case.name}
    say(f"{case.name}: costs")
    record["seconds"] = _seconds(device, case, options.rounds)
    yield record
    say(f"{options.size} x {options.size}: a disc and the head")
    record["phases"] = {name: _phase_error(device, name) for name in FOOTPRINTS}
    record["flatness"] = [
        _flatness(device, name, options.size, spacing)
        for spacing in _SPACINGS
        for name in FOOTPRINTS
    ]
    record["head"] = [
        {"footprint": name, "views": views, **_head(device, name, options.size, views)}
        for views in options.views
        for name in FOOTPRINTS
    ]
    yield record


def _seconds(device: rift.Device, case: Case, rounds: int) -> dict[str, dict[str, list[float]]]:
    """Processor seconds of each turn, by direction and footprint; the first turn warms up."""
    operators = {
        name: rift.Projector(case.grid, case.scan, name, device=device) for name in FOOTPRINTS
    }
    x, y = device.array(case.image), device.array(case.projections)
    found: dict[str, dict[str, list[float]]] = {"forward": {}, "backward": {}}
    for turn in range(rounds + 1):
        for name, A in operators.items():
            for way, operator, given in (("forward", A, x), ("backward", A.T, y)):
                device.finish()
                began = time.process_time()
                operator(given)
                device.finish()
                if turn:
                    found[way].setdefault(name, []).append(time.process_time() - began)
    return found


def _phase_error(device: rift.Device, footprint: str) -> float:
    """Relative distance of a projected white image from what the exact transform gives."""
    A = _projector(device, footprint, 96, 150)
    x = np.random.default_rng(0).standard_normal(A.domain)
    exact = radon(A.grid, A.scan, footprint).project(x)
    return float(np.linalg.norm(A(x) - exact) / np.linalg.norm(exact))


def _flatness(device: rift.Device, footprint: str, size: int, spacing: float) -> dict[str, Any]:
    """Mean and standard deviation of ``fbp(A, A(disc))`` inside a uniform disc of one, by views."""
    edge = round(size / max(1, spacing))
    radius, found = _RADIUS * edge * spacing, dict[str, list[float]]()
    for views in _VIEWS:
        A = _projector(device, footprint, edge, views, spacing)
        disc = phantom.render([phantom.Ellipsoid((0, 0, 0), (1, radius, radius), 0, 1)], A.grid)
        y, x = A.grid.coordinates(0)[:, None], A.grid.coordinates(1)
        inside = np.hypot(y, x) < radius - _MARGIN * max(1, spacing)
        values = rift.fbp(A, A(disc))[inside].astype(float)
        found[str(views)] = [float(values.mean()), float(values.std())]
    return {"spacing": spacing, "footprint": footprint, "by_views": found}


def _head(device: rift.Device, footprint: str, size: int, views: int) -> dict[str, float]:
    """PSNR of reconstructions from the head's analytic sinogram."""
    A = _projector(device, footprint, size, views)
    truth, y = phantom.shepp_logan(A.grid), phantom.shepp_logan_sinogram(A.grid, A.scan)
    pictures = {"fbp": rift.fbp(A, y), "cgls": rift.cgls(A, y, _STEPS)}
    inside = metrics.disc(A.grid)
    return {name: metrics.psnr(image, truth, mask=inside) for name, image in pictures.items()}


def _projector(
    device: rift.Device, footprint: str, size: int, views: int, spacing: float = 1.0
) -> rift.Projector:
    angles = np.linspace(0, np.pi, views, endpoint=False)
    scan = rift.Parallel(angles, bins=int(2**0.5 * size * spacing) + 3)
    return rift.Projector(rift.Grid((size, size), spacing), scan, footprint, device=device)


def _tables(record: dict[str, Any]) -> Iterator[Table]:
    yield _cost_table(record)
    if "head" in record:
        yield _flatness_table(record)
        yield _phase_table(record)
        yield _head_table(record)


def _cost_table(record: dict[str, Any]) -> Table:
    rows = []
    for name in FOOTPRINTS:
        cells = [name]
        for runs in record["seconds"].values():
            ratio = median(a / b for a, b in zip(runs[name], runs[_BASE], strict=True))
            cells += [milliseconds(min(runs[name])), f"{ratio:.2f}"]
        rows.append(cells)
    heads = ("footprint", "forward, ms", f"to {_BASE}", "backward, ms", f"to {_BASE}")
    notes = ("Processor time: the least, and the median of the ratios within a turn.",)
    return Table(f"Cost of footprints, {record['cost']}", heads, rows, notes)


def _flatness_table(record: dict[str, Any]) -> Table:
    rows = [
        [f["footprint"], f"{f['spacing']:g}"]
        + [text for mean, sd in f["by_views"].values() for text in (f"{mean:.4f}", f"{sd:.2%}")]
        for f in record["flatness"]
    ]
    heads = ["footprint", "spacing, bins"]
    heads += [f"{what}, {views} views" for views in _VIEWS for what in ("mean", "sd")]
    note = (
        f"Inside a disc of up to {2 * _RADIUS * record['size']:.0f} bins across, {_MARGIN} bins or "
        "samples from its edge."
    )
    return Table("fbp(A, A(disc)) of a uniform disc", heads, rows, (note,))


def _phase_table(record: dict[str, Any]) -> Table:
    rows = [[name, f"{error:.2%}"] for name, error in record["phases"].items()]
    heads = ("footprint", "off the exact transform")
    return Table("White noise of 96 x 96, 150 views", heads, rows, ("Relative L2 norm.",))


def _head_table(record: dict[str, Any]) -> Table:
    size = record["size"]
    rows = [
        [str(h["views"]), h["footprint"], f"{h['fbp']:.2f}", f"{h['cgls']:.2f}"]
        for h in record["head"]
    ]
    heads = ("views", "footprint", "FBP, dB", f"CGLS of {_STEPS} steps, dB")
    title = f"Shepp-Logan head of {size} x {size}, analytic sinogram"
    return Table(title, heads, rows, texts=2)


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    return report(
        "bench_footprints",
        measure_all(options),
        json_file=options.json,
        markdown_file=options.markdown,
        page=lambda record: "\n".join(markdown_lines(_tables(record))) + "\n",
        tables=_tables,
    )


if __name__ == "__main__":
    sys.exit(main())
