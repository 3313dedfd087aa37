"""Does a driver compute the same numbers as PoCL? Families of kernels, a table, an exit status.

    python tools/compare_drivers.py --device intel            # beside PoCL in the same environment
    python tools/compare_drivers.py --device pocl --as-gpu    # one lane, groups of 64
    python tools/compare_drivers.py --device pocl --save pocl.npz
    python tools/compare_drivers.py --device radeon --against pocl.npz --json radeon.json

Each device runs in a process of its own, so that a compiler which dies costs one family. A row says
"=" where every bit is equal, or the relative L2 difference of the worst array. Ends with status 1
where a family died, failed, or differs by more than rounding explains.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

import rift_cl as rift
from bench.table import Table, show
from portability.differences import bound, worst
from portability.family_runs import FamilyRun, run_families
from portability.problems import FAMILIES
from rift_cl.io import write_text

_HEAD = ("family", "arrays", "difference", "worst array", "s")


@dataclass(frozen=True)
class Options:
    """Run fixed problems of every family of kernels on a device and compare with a reference.

    Args:
        device: which OpenCL device to try, as RIFT_DEVICE selects it; the default one if not given.
        against: the reference: a device's selector, or an NPZ file that --save wrote.
        save: NPZ file for the arrays; nothing is compared then.
        json: file for the table.
        as_gpu: take the tried device for a GPU, if it is a CPU: one lane, groups of 64.
        tiny: the smallest sizes, for slow drivers.
        only: families to run; all if not given.
        limit: seconds without a result, after which a family is given up.
    """

    device: str | None = None
    against: str = "pocl"
    save: Path | None = None
    json: Path | None = None
    as_gpu: bool = False
    tiny: bool = False
    only: tuple[str, ...] = ()
    limit: float = 600.0


def main(options: Options) -> int:
    """Run, print and write what was asked for; the exit status."""
    unknown = set(options.only) - FAMILIES.keys()
    if unknown:
        print(f"no family is called {', '.join(sorted(unknown))}; there is: {', '.join(FAMILIES)}")
        return 2
    names = options.only or tuple(FAMILIES)
    try:
        device = rift.open_device(options.device)
        reference = None if options.save else _reference(options, names)
    except (rift.RiftError, OSError) as error:
        print(f"compare_drivers: {error}", file=sys.stderr)
        return 1
    dress = ", taken for a GPU" if options.as_gpu and device.traits.is_cpu else ""
    title = f"{device.name} ({device.platform}, {device.driver}{dress})"
    rows, saved = [], {}
    for run in run_families(
        names, device=options.device, as_gpu=options.as_gpu, tiny=options.tiny, limit=options.limit
    ):
        rows.append(_row(run, reference))
        print(f"{run.name}: {rows[-1]['difference']}", file=sys.stderr, flush=True)
        saved |= {f"{run.name}/{key}": array for key, array in (run.arrays or {}).items()}
    if options.save:
        np.savez_compressed(options.save, **saved)
    if options.json:
        record = {"device": title, "version": rift.__version__, "against": options.against}
        write_text(options.json, json.dumps(record | {"families": rows}, indent=1) + "\n")
    show([Table(title, _HEAD, [tuple(str(row[key]) for key in _HEAD) for row in rows])])
    return int(any(row["failed"] for row in rows))


def _reference(options: Options, names: tuple[str, ...]) -> dict[str, FamilyRun]:
    """What each family should give: read from a file, or run on another device."""
    if options.against.endswith(".npz"):
        found: dict[str, dict[str, np.ndarray]] = {name: {} for name in names}
        with np.load(options.against) as file:
            for key in file.files:
                family, _, name = key.partition("/")
                if family in found:
                    found[family][name] = file[key]
        return {name: FamilyRun(name, arrays) for name, arrays in found.items()}
    rift.open_device(options.against)
    runs = run_families(
        names, device=options.against, as_gpu=False, tiny=options.tiny, limit=options.limit
    )
    return {run.name: run for run in runs}


def _row(run: FamilyRun, reference: dict[str, FamilyRun] | None) -> dict[str, Any]:
    row = {"family": run.name, "arrays": len(run.arrays or ()), "s": round(run.seconds, 1)}
    if run.arrays is None:
        return row | {"difference": run.fault, "worst array": "", "failed": True}
    if not run.arrays:
        return row | {"difference": "not on this device", "worst array": "", "failed": False}
    if reference is None:
        return row | {"difference": "saved", "worst array": "", "failed": False}
    wanted = reference[run.name]
    if wanted.arrays is None:
        return row | {"difference": f"reference: {wanted.fault}", "worst array": "", "failed": True}
    found = worst(wanted.arrays, run.arrays)
    shown = f"{found.relative:.1e}" if found.relative else "="
    failed = found.relative > bound(run.name)
    return row | {
        "difference": shown,
        "worst array": found.array if found.relative else "",
        "failed": failed,
    }


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options)))
