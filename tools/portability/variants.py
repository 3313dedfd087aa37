"""The kernels with the macros that they are built with: what a compiler must take.

`kernel_variants.json` lists what runs of the tests launched (`pytest --record-kernels`), a line for
each: the kernel, the kind of device, its macros. Every kernel is there with its own defaults too.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from rift_cl.cl.build.source import kernel_names

RECORDED = Path(__file__).with_name("kernel_variants.json")
_KINDS = ("cpu", "gpu")


class Variant(NamedTuple):
    """A kernel as it is built.

    Args:
        kernel: its name.
        kind: of the device, "cpu" or "gpu".
        macros: as NAME=VALUE, without those that every kernel is told.
    """

    kernel: str
    kind: str
    macros: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The kernel, the kind of device and the macros in a line."""
        return " ".join((self.kernel, self.kind, *self.macros))

    @property
    def defines(self) -> list[str]:
        """The options that a compiler is given."""
        lanes = ("LANES=8", "GROUP=1") if self.kind == "cpu" else ("LANES=1", "GROUP=64")
        return [f"-D{macro}" for macro in (*lanes, "RIFT_POCL=0", *self.macros)]


def variants(kernels: tuple[str, ...] = ()) -> list[Variant]:
    """Every variant that is known of these kernels, or of all that there are."""
    names = kernels or tuple(kernel_names())
    wanted = {variant for variant in (*_recorded(), *_defaults()) if variant.kernel in names}
    return sorted(wanted)


def _recorded() -> Iterator[Variant]:
    for line in json.loads(RECORDED.read_text(encoding="utf-8")):
        kernel, kind, *macros = line.split()
        yield Variant(kernel, kind, tuple(macros))


def _defaults() -> Iterator[Variant]:
    for name in kernel_names():
        own = name.rpartition("_")[2]
        yield from (Variant(name, kind) for kind in _KINDS if own not in _KINDS or kind == own)
