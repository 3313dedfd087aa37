"""What the rasterizer's kernels for GPUs take of one: registers, spills, local memory, occupancy.

    python tools/raster_registers.py                   # beside what is held, and an older version
    python tools/raster_registers.py --update          # hold what they take now
    PYTHONPATH=OLDER_CHECKOUT python tools/raster_registers.py --older 79177a8

No GPU is needed: clang compiles for AMD's gfx1100, and ptxas, where it is installed, for NVIDIA's
sm_80. `tools/compile_gate.py` holds the worst variant of every kernel; here stand single ones, by
channels and by the order of Hermite modes, so that a launch of three channels is seen apart.
`portability/raster_registers.json` holds the figures. Ends with status 1 where a kernel takes more
than is held.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from bench.table import Table, show
from portability.offline import CLANG, compile_by_ptxas, compile_for, why_not
from portability.variants import Variant
from rift_cl.cl.build.source import kernel_names
from rift_cl.io import write_text

HELD = Path(__file__).parent / "portability" / "raster_registers.json"
_NUMBERS = ("vgprs", "sgprs", "spilled", "scratch", "local", "occupancy", "ptx", "ptx_spilled")
_HEAD = (
    *("kernel", "of", "version", "VGPRs", "SGPRs", "spilled", "scratch, bytes", "local, bytes"),
    *("occupancy of 16", "sm_80 registers", "spilled, bytes"),
)
_MODES = "CHANNELS=3 ACTIVATION=0 COLOR_ORDER=0 COLORED=0 SHAPE_ORDER="
# A launch of Gaussians does eight channels, and one before did 32.
_CASES = {
    "3 channels": "CHANNELS=3 PACKED=1",
    "8 channels": "CHANNELS=8",
    "32 channels": "CHANNELS=8",
    "order 0": f"MODAL=1 PACKED=1 {_MODES}0",
    "order 2": f"MODAL=1 PACKED=1 {_MODES}2",
    "order 4": f"MODAL=1 PACKED=1 {_MODES}4",
    "order 8": f"MODAL=1 PACKED=1 {_MODES}8",
}
_OLDER_CASES = {**_CASES, "32 channels": "CHANNELS=32"}
# A few registers more are no fault: they are given out in blocks of 8 at least.
_MORE = {"vgprs": 8, "ptx": 8}

Row = dict[str, int | None]


@dataclass(frozen=True)
class Options:
    """Compile the rasterizer's kernels for GPUs offline and show what they take.

    Args:
        only: cases; all if not given.
        update: hold what they take now.
        older: the kernels found are those of this older commit: hold what they take as its.
    """

    only: tuple[str, ...] = ()
    update: bool = False
    older: str = ""


def main(options: Options) -> int:
    """Compile, and print or keep the table; the exit status."""
    missing = why_not()
    if missing:
        print(f"raster_registers: {missing}", file=sys.stderr)
        return 2
    held = json.loads(HELD.read_text(encoding="utf-8")) if HELD.is_file() else {}
    now = rows(options.only, older=bool(options.older))
    if options.older:
        held |= {"older": options.older, "before": now}
    elif options.update:
        held["now"] = held.get("now", {}) | now
    if options.older or options.update:
        write_text(HELD, _text({"compiler": CLANG, **held}))
    show([_table(held, now)])
    faults = [] if options.older else list(excesses(now, held.get("now", {})))
    for fault in faults:
        print(fault)
    return int(bool(faults))


def rows(only: tuple[str, ...] = (), *, older: bool = False) -> dict[str, Row]:
    """What each kernel takes in each case, by "kernel, case"."""
    found = {}
    for case, macros in (_OLDER_CASES if older else _CASES).items():
        for name in ("raster_gpu", "raster_grad_gpu"):
            if not only or case in only:
                found[f"{name}, {case}"] = _row(_variant(name, macros))
    return found


def excesses(now: dict[str, Row], held: dict[str, Row]) -> list[str]:
    """What is more than is held, in sentences."""
    faults = []
    for key, row in now.items():
        for number in ("vgprs", "scratch", "local", "ptx", "ptx_spilled"):
            taken, most = row[number], held.get(key, {}).get(number)
            if taken is not None and most is not None and taken > most + _MORE.get(number, 0):
                faults.append(f"{key}: {taken} {number}, held are {most}")
    return faults


def _variant(name: str, macros: str) -> Variant:
    """The kernel that draws a case; older versions had others for splats with modes."""
    older, modal = "hermite_raster_gpu" in kernel_names(), "MODAL=1" in macros
    kernel = f"{'hermite' if older and modal else 'splat'}_{name}"
    group = () if older else ("GROUP=256",)
    return Variant(kernel, "gpu", (*macros.split(), *group))


def _row(variant: Variant) -> Row:
    done = compile_for(variant, "gfx1100")
    if done.resources is None:
        raise RuntimeError(f"{variant}: {done.fault}")
    taken: dict[str, Any] = done.resources._asdict() | {
        "sgprs": done.sgprs,
        "spilled": done.spilled,
    }
    ptx = compile_by_ptxas(variant)
    taken |= {"ptx": ptx and ptx.registers, "ptx_spilled": ptx and ptx.spilled}
    return {number: taken[number] for number in _NUMBERS}


def _text(held: dict[str, Any]) -> str:
    parts = []
    for key, value in held.items():
        if isinstance(value, dict):
            lines = ",\n".join(f'  "{name}": {json.dumps(row)}' for name, row in value.items())
            parts.append(f'"{key}": {{\n{lines}\n}}')
        else:
            parts.append(f'"{key}": {json.dumps(value)}')
    return "{" + ",\n".join(parts) + "}\n"


def _table(held: dict[str, Any], now: dict[str, Row]) -> Table:
    shown = []
    for key, row in now.items():
        versions = {held.get("older", "before"): held.get("before", {}).get(key), "held": None}
        versions["held"] = held.get("now", {}).get(key)
        for version, numbers in {**versions, "now": row}.items():
            if numbers:
                cells = ("–" if numbers[each] is None else str(numbers[each]) for each in _NUMBERS)
                shown.append((*key.split(", "), version, *cells))
    return Table(f"The rasterizer on GPUs by {CLANG} and ptxas", _HEAD, shown)


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options)))
