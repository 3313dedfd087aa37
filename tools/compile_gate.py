"""Does every kernel compile as OpenCL C 1.2, and does it fit a GPU? No driver is needed.

    python tools/compile_gate.py                                  # all kernels, all recorded macros
    python tools/compile_gate.py --only radon_project adam
    python tools/compile_gate.py --update                         # keep the registers of today
    pytest -m full --record-kernels tools/portability/kernel_variants.json

clang compiles for spir64, spir and AMD's gfx1100. The table shows, for each kernel on gfx1100, the
worst of its variants. Ends with status 1 where one does not compile, spills registers into scratch
memory (but for those that `tools/portability/gfx1100.json` names), takes more than 32 KiB of local
memory, or over 8 registers more than that file holds. The last line records the macros that tests
launch with.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from bench.table import Table, show
from portability.offline import CLANG, TARGETS, Compiled, Resources, compile_for, why_not
from portability.variants import Variant, variants
from rift_cl.io import write_text

HELD = Path(__file__).parent / "portability" / "gfx1100.json"
_MOST_LOCAL = 32 << 10
# A few registers more are no fault: they are given out in blocks of 8 at least.
_MORE = {"vgprs": 8, "scratch": 0, "local": 0}
_HEAD = ("kernel", "variants", "VGPRs", "held", "scratch, bytes", "local, bytes", "occupancy of 16")


@dataclass(frozen=True)
class Options:
    """Compile kernels offline and hold what they take of a GPU.

    Args:
        only: kernels; all if not given.
        targets: of spir64, spir and gfx1100.
        jobs: compilers at a time; as many as there are cores if not given.
        update: keep what the kernels take now as what they may take.
    """

    only: tuple[str, ...] = ()
    targets: tuple[str, ...] = TARGETS
    jobs: int | None = None
    update: bool = False


def main(options: Options) -> int:
    """Compile, print the table and the faults; the exit status."""
    missing = why_not()
    if missing:
        print(f"compile_gate: {missing}", file=sys.stderr)
        return 2
    known = variants(options.only)
    with ThreadPoolExecutor(options.jobs or os.cpu_count()) as pool:
        compiled = list(pool.map(lambda work: compile_for(*work), _work(known, options.targets)))
    taken = _worst(compiled)
    held = {name: Resources(**each) for name, each in _held().items()}
    if options.update:
        held |= taken
        write_text(HELD, _text({name: held[name] for name in sorted(held)}))
    show([_table(taken, held, known)])
    faults = [*_faults(compiled), *_excesses(taken, held)]
    for fault in faults:
        print(fault)
    print(f"{len(compiled)} compilations of {len(known)} variants: {len(faults)} faults")
    return int(bool(faults) or not compiled)


def _work(known: Iterable[Variant], targets: Iterable[str]) -> Iterator[tuple[Variant, str]]:
    for variant in known:
        for target in targets:
            if target != "gfx1100" or variant.kind == "gpu":
                yield variant, target


def _held() -> dict[str, Any]:
    return json.loads(HELD.read_text(encoding="utf-8"))["kernels"] if HELD.is_file() else {}


def _text(held: dict[str, Resources]) -> str:
    lines = (f'  "{name}": {json.dumps(each._asdict())}' for name, each in held.items())
    return f'{{"compiler": "{CLANG}", "kernels": {{\n' + ",\n".join(lines) + "\n}}\n"


def _worst(compiled: Iterable[Compiled]) -> dict[str, Resources]:
    """Of each kernel, the most that any of its variants takes."""
    worst: dict[str, Resources] = {}
    for each in compiled:
        now = each.resources
        if now is not None:
            name = each.variant.kernel
            before = worst.get(name, now)
            most = (max(pair) for pair in zip(before[:3], now[:3], strict=True))
            worst[name] = Resources(*most, min(before.occupancy, now.occupancy))
    return worst


def _faults(compiled: Iterable[Compiled]) -> Iterator[str]:
    return (f"{each.target}: {each.variant}: {each.fault}" for each in compiled if each.fault)


def _excesses(taken: dict[str, Resources], held: dict[str, Resources]) -> Iterator[str]:
    """What is more than the table holds, or than any device has to have."""
    for name, now in sorted(taken.items()):
        if now.local > _MOST_LOCAL:
            yield f"{name}: {now.local} bytes of local memory; {_MOST_LOCAL} is what devices have"
        if name not in held:
            yield f"{name}: not in {HELD.name} yet (--update)"
            continue
        for what, more in _MORE.items():
            most = getattr(held[name], what)
            if getattr(now, what) > most + more:
                yield f"{name}: {getattr(now, what)} {what}, held are {most}"


def _table(taken: dict[str, Resources], held: dict[str, Resources], known: list[Variant]) -> Table:
    rows = []
    for name, now in sorted(taken.items()):
        count = sum(variant.kernel == name for variant in known)
        limit = str(held[name].vgprs) if name in held else "–"
        shown = (count, now.vgprs, limit, now.scratch, now.local, now.occupancy)
        rows.append((name, *map(str, shown)))
    return Table(f"gfx1100 by {CLANG}, the worst variant of each kernel", _HEAD, rows)


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options)))
