"""Which kernels became slower between two benchmark results.

    python tools/compare_benchmarks.py                         # the last two of one device
    python tools/compare_benchmarks.py OLD.json NEW.json --slower 1.2

Results are those that ``bench_kernels.py --keep`` wrote. The exit status is 1 if a kernel is slower
by the factor ``--slower`` or more. The limits of the device (multiply-adds, memory, launches) are
compared first: if they differ too, the machine was busy or is another one.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from bench.history import FOLDER, Change, Record, changes, load
from bench.table import Table, show
from rift_cl import RiftError
from rift_cl.errors import InputError


@dataclass(frozen=True)
class Options:
    """Compare two benchmark results, kernel by kernel.

    Args:
        results: the older and the newer file; without them the last two of one device in --folder.
        slower: ratio of times from which a kernel counts as slower.
        shortest: kernels that took fewer microseconds than this in the older result are left out.
        folder: where results are kept.
    """

    results: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    slower: float = 1.2
    shortest: float = 20.0
    folder: Path = FOLDER


def last_two(folder: Path) -> tuple[Path, Path]:
    """The newest result of a folder, and the one before it of the same device.

    Raises:
        InputError: there is no such pair.
    """
    found = sorted(folder.glob("[0-9]*-*.json"))
    if found:
        device = load(found[-1])["device"]["name"]
        same = [path for path in found[:-1] if load(path)["device"]["name"] == device]
        if same:
            return same[-1], found[-1]
    raise InputError(
        f"{folder} has no two results of one device; make one with bench_kernels.py --keep {folder}"
    )


def compare(old: Record, new: Record, options: Options) -> tuple[list[Table], int]:
    """The tables to show, and the number of kernels that became slower."""
    least = options.shortest * 1e-6
    timed = [change for change in changes(old, new) if change.old >= least]
    slower = [change for change in timed if change.ratio >= options.slower]
    quicker = [change for change in timed[::-1] if change.ratio <= 1 / options.slower]
    limits = [
        (name, f"{old['limits'][name]:.4g}", f"{new['limits'][name]:.4g}")
        for name in old["limits"].keys() & new["limits"].keys()
    ]
    heads = [f"{record['date'][:10]}, {record['device']['name']}" for record in (old, new)]
    columns = ("kernel", "older, us", "newer, us", "ratio")
    rest = (
        f"{len(timed) - len(slower) - len(quicker)} of {len(timed)} kernels are within the factor."
    )
    return [
        Table("Limits of the device", ("limit", *heads), sorted(limits), ()),
        Table(f"Slower by {options.slower} or more", columns, _rows(slower), ()),
        Table(f"Faster by {options.slower} or more", columns, _rows(quicker), (rest,)),
    ], len(slower)


def _rows(found: list[Change]) -> list[tuple[str, str, str, str]]:
    return [
        (each.what, f"{each.old * 1e6:.4g}", f"{each.new * 1e6:.4g}", f"{each.ratio:.2f}")
        for each in found
    ]


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    try:
        if len(options.results) not in (0, 2):
            raise InputError("give two results, the older first, or none")
        paths = options.results or last_two(options.folder)
        tables, slower = compare(*(load(path) for path in paths), options)
    except RiftError as error:
        print(f"compare_benchmarks: {error}", file=sys.stderr)
        return error.exit_status
    show(tables)
    return int(slower > 0)


if __name__ == "__main__":
    sys.exit(main())
