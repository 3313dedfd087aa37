"""How fast the kernels are, how near to the device's limits, and how they compare with peers.

    python tools/bench_kernels.py --json bench.json
    python tools/bench_kernels.py --peers --json b.json --markdown docs/benchmarks/performance.md
    python tools/bench_kernels.py --json bench.json --keep docs/benchmarks
    python tools/bench_kernels.py --only "beams from a point" --json b.json --markdown PAGE

Limits, kernels and whole operations are measured in one process on one device. A kernel that is
shipped and not measured makes the run fail, so that none is forgotten. With --only a group is
measured alone, and its table takes the place of the former one on a page that was printed before.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import tyro

import rift_cl as rift
from bench.case import Case
from bench.command import report, say
from bench.contender import Contender, RiftOnDevice, RiftOnHost
from bench.costs import check_known, check_measured
from bench.groups import KNOWN, groups
from bench.limits import LimitMeter, Limits
from bench.operations import Split, split_record, splits
from bench.peers import PEERS, STACK_PEERS, ScikitImage
from bench.projections import projection_tasks
from bench.race import compared
from bench.rasterizers import RASTERIZERS
from bench.splats import SplatCase
from bench.surroundings import surroundings
from bench.tables import markdown, renewed, tables
from rift_cl.cl.build.source import kernel_names
from rift_cl.errors import InputError

_SIZES = ("256x384", "512x768", "2048x1500")
_QUICK_SIZES = ("256x384",)
_GROUPS_AT, _QUICK_GROUPS_AT = "512x768", "128x192"
# Splats, and pixels along a side.
_SPLATS = ((10_000, 256), (10_000, 512), (100_000, 256), (100_000, 512))
_QUICK_SPLATS = ((10_000, 256), (30_000, 256))
# Updates from which peers run once (they need minutes), and up to which a stack is measured.
_ONCE_UPDATES = 2e9
_STACK_UPDATES = 1e10
_OURS: tuple[type[Contender], ...] = (RiftOnDevice, RiftOnHost)


@dataclass(frozen=True)
class Options:
    """Measure the kernels, and with --peers other packages on the same work.

    Args:
        json: file for every figure and every raw time.
        markdown: file for the tables, ready for the documentation.
        keep: folder for the result by date, DATE-DEVICE.json, which tools/compare_benchmarks.py
            compares with others.
        peers: also run ASTRA, silx, gratopy, scikit-image and a rasterizer in torch, on a GPU
            those that use it (ASTRA's CUDA, silx, gratopy, gsplat), as far as they are installed.
        only: name of the one group to measure, as its table has it after "Kernels, "; on the page
            of --markdown, which is there already, that table alone is replaced.
        quick: one size and few repeats.
        device: which OpenCL device, as RIFT_DEVICE selects it.
        sizes: PIXELSxVIEWS, any number of them.
        groups: PIXELSxVIEWS at which filters, footprints, vectors and solvers are measured.
        splats: (splats, pixels along a side) of the scenes that are drawn.
        slices: slices of the stack that is measured beside each image; 1 for no stack.
        rounds: how often each measurement is repeated; by size when not given.
        seed: of the white noise in the adjoint tests.
    """

    json: Path
    markdown: Path | None = None
    keep: Path | None = None
    peers: bool = False
    only: str | None = None
    quick: bool = False
    device: str | None = None
    sizes: tuple[str, ...] = ()
    groups: str | None = None
    splats: tuple[tuple[int, int], ...] = ()
    slices: int = 16
    rounds: int | None = None
    seed: int = 0


@dataclass
class Measured:
    """What was measured at one size; shares wait for the limits of the whole run."""

    splits: list[Split]
    record: dict[str, Any]

    def finished(self, limits: Limits) -> dict[str, Any]:
        """The JSON record, shares of the limits included."""
        return {**self.record, "splits": [split_record(split, limits) for split in self.splits]}


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """Run the benchmark, size by size.

    Yields:
        The record of all that was measured so far, after each size, so that a long run which is
        stopped leaves what it has.

    Raises:
        CoverageError: a shipped kernel has no cost or was not launched.
        RiftError: no device fits, or a size cannot be read.
    """
    sizes = options.sizes or (_QUICK_SIZES if options.quick else _SIZES)
    cases = [Case.parse(size) for size in sizes]
    check_known(kernel_names(), KNOWN)
    device = rift.open_device(options.device)
    meter, skipped = LimitMeter(device), dict[str, str]()
    driven = [name for name in kernel_names() if _drives(name, device)]
    if options.only is not None:
        grouped = _measure_groups(meter, options)
        yield _record(meter, options, driven, skipped, [], grouped, [])
        return
    drawn, grouped = _draw(meter, options), _measure_groups(meter, options)
    measured: list[Measured] = []
    for case in cases:
        measured += _measure(meter, case, options, skipped)
        done = [split for found in (*measured, *drawn, *grouped) for split in found.splits]
        check_measured(driven, {name for split in done for name in split.kernels})
        yield _record(meter, options, driven, skipped, measured, grouped, drawn)


def _record(
    meter: LimitMeter,
    options: Options,
    driven: Sequence[str],
    skipped: dict[str, str],
    measured: Sequence[Measured],
    grouped: Sequence[Measured],
    drawn: Sequence[Measured],
) -> dict[str, Any]:
    return {
        **surroundings(meter.device),
        "seed": options.seed,
        "limits": {**asdict(meter.best()), "raw": [asdict(each) for each in meter.measured]},
        "formulas": {name: KNOWN[name].formula for name in driven},
        "skipped": skipped,
        "cases": [found.finished(meter.best()) for found in measured],
        "groups": [found.finished(meter.best()) for found in grouped],
        "splats": [found.finished(meter.best()) for found in drawn],
    }


def _drives(kernel: str, device: rift.Device) -> bool:
    """Whether a kernel is for this kind of device: some have a driver for each kind."""
    return not kernel.endswith("_gpu" if device.traits.is_cpu else "_cpu")


def _draw(meter: LimitMeter, options: Options) -> list[Measured]:
    found, skipped = [], dict[str, str]()
    kinds = _fitting(RASTERIZERS, meter.device) if options.peers else ()
    for count, size in options.splats or (_QUICK_SPLATS if options.quick else _SPLATS):
        case = SplatCase(count, size, meter.device)
        say(f"{case.name}: {', '.join(['kernels', *(kind.name for kind in kinds)])}")
        rounds = options.rounds or (2 if options.quick else 8)
        kernel_splits = splits(meter, case.tasks, repeats=rounds)
        lead = compared(
            kinds, meter.device, case, rounds=rounds, seed=options.seed, skipped=skipped
        )
        found.append(Measured(kernel_splits, {**case.record(), **lead, "left_out": dict(skipped)}))
    return found


def _measure_groups(meter: LimitMeter, options: Options) -> list[Measured]:
    case = Case.parse(options.groups or (_QUICK_GROUPS_AT if options.quick else _GROUPS_AT))
    rounds, found = options.rounds or (2 if options.quick else 5), []
    every = groups(meter.device, case)
    chosen = [group for group in every if options.only in (None, group.name)]
    if not chosen:
        names = "; ".join(group.name for group in every)
        raise InputError(f"--only is {options.only!r}, wanted one of: {names}")
    for group in chosen:
        say(group.name)
        kernel_splits = splits(meter, group.tasks(), repeats=rounds)
        sizes = {split.task.operation: split.task.case.record() for split in kernel_splits}
        found.append(Measured(kernel_splits, {"name": group.name, "sizes": sizes}))
    return found


def _measure(
    meter: LimitMeter, case: Case, options: Options, skipped: dict[str, str]
) -> Iterator[Measured]:
    peers = _fitting(PEERS, meter.device) if options.peers else ()
    left_out = dict[str, str]()
    if ScikitImage in peers and case.updates > _ONCE_UPDATES:
        peers = tuple(peer for peer in peers if peer is not ScikitImage)
        left_out[ScikitImage.name] = "it would take minutes at this size"
    yield _measure_one(
        meter, case, options, kinds=(*_OURS, *peers), skipped=skipped, left_out=left_out
    )
    stack = replace(case, slices=options.slices)
    if stack.slices > 1 and stack.updates <= _STACK_UPDATES:
        kinds = (*_OURS, *(_fitting(STACK_PEERS, meter.device) if options.peers else ()))
        yield _measure_one(meter, stack, options, kinds=kinds, skipped={}, left_out={})


def _fitting(kinds: Sequence[type[Contender]], device: rift.Device) -> tuple[type[Contender], ...]:
    return tuple(kind for kind in kinds if kind.fits(device))


def _measure_one(
    meter: LimitMeter,
    case: Case,
    options: Options,
    *,
    kinds: Sequence[type[Contender]],
    skipped: dict[str, str],
    left_out: dict[str, str],
) -> Measured:
    say(f"{case.name}: kernels")
    rounds = options.rounds or (2 if options.quick else 5 if case.updates < 1e8 else 3)
    kernel_splits = splits(meter, projection_tasks(meter.device, case), repeats=rounds)
    say(f"{case.name}: {', '.join(kind.name for kind in kinds)}")
    slow_peers = len(kinds) > len(_OURS) and meter.device.traits.is_cpu
    once = slow_peers and case.updates > _ONCE_UPDATES
    lead = compared(
        *(kinds, meter.device, case),
        rounds=1 if once else rounds,
        warm_up=not once,
        seed=options.seed,
        skipped=skipped,
    )
    record = {
        **case.record(),
        **lead,
        "dot_test": _dot_test(meter.device, case, options.seed) if case.slices == 1 else None,
        "peers_once": once,
        "left_out": left_out,
    }
    return Measured(kernel_splits, record)


def _dot_test(device: rift.Device, case: Case, seed: int) -> float:
    return rift.dot_test(rift.Projector(case.grid, case.scan, device=device), seed=seed)


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    page = markdown
    if options.only is not None and options.markdown is not None:
        page = partial(renewed, options.markdown.read_text(encoding="utf-8"))
    return report(
        "bench_kernels",
        measure_all(options),
        keep_in=options.keep,
        json_file=options.json,
        markdown_file=options.markdown,
        page=page,
        tables=tables,
    )


if __name__ == "__main__":
    sys.exit(main())
