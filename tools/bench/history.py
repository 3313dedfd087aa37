"""Benchmark results kept by date, and which kernels became slower between two of them.

A kept result is the part of a benchmark's record that later runs are compared with: date, version,
device, host, the device's limits, and the shortest and the median time of every kernel of every
operation. Raw times stay in the file that the benchmark itself writes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rift_cl.errors import InputError
from rift_cl.io import write_text

Record = dict[str, Any]
FOLDER = Path(__file__).parents[2] / "docs" / "benchmarks"
_HEAD = ("version", "date", "device", "host", "packages", "import_s")
_LIMITS = ("multiply_add", "bandwidth", "launch")
_CASES = ("cases", "groups", "splats")


@dataclass(frozen=True)
class Change:
    """A kernel in two results: where it was timed, and its shortest times in seconds."""

    what: str
    old: float
    new: float

    @property
    def ratio(self) -> float:
        """How many times as long it takes now."""
        return self.new / self.old


def kept(record: Record) -> Record:
    """What is kept of a record of ``bench_kernels``: no raw times, microseconds to four digits."""
    return {
        **{name: record[name] for name in _HEAD},
        "limits": {name: record["limits"][name] for name in _LIMITS},
        "kernels_us": dict(_times(record)),
    }


def keep(record: Record, folder: Path = FOLDER, kept: Callable[[Record], Record] = kept) -> Path:
    """Write a record's result as DATE-DEVICE.json, in place of an earlier one; return its path.

    Args:
        record: of a benchmark.
        folder: where results of this benchmark are kept; made where it is not there.
        kept: what is kept of a record.
    """
    device = re.sub(r"[^a-z0-9]+", "-", record["device"]["name"].lower()).strip("-")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{record['date'][:10]}-{device}.json"
    write_text(path, json.dumps(kept(record), indent=1) + "\n")
    return path


def load(path: Path) -> Record:
    """A kept result.

    Raises:
        InputError: the file holds something else.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if all(isinstance(record[name], dict) for name in ("device", "limits", "kernels_us")):
            return dict(record)
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise InputError(f"{path} is no benchmark result that bench_kernels.py --keep wrote")


def changes(old: Record, new: Record) -> list[Change]:
    """Every kernel that both results timed, the one that became slowest first."""
    before, now = old["kernels_us"], new["kernels_us"]
    found = [
        Change(what, before[what][0] * 1e-6, now[what][0] * 1e-6)
        for what in before.keys() & now.keys()
    ]
    return sorted(found, key=lambda change: (-change.ratio, change.what))


def _times(record: Record) -> Iterator[tuple[str, list[float]]]:
    for case in (case for group in _CASES for case in record[group]):
        for split in case["splits"]:
            for kernel in split["kernels"]:
                times = (kernel["min_s"], kernel["median_s"])
                name = f"{case['name']} / {split['operation']} / {kernel['kernel']}"
                yield name, [float(f"{seconds * 1e6:.4g}") for seconds in times]
