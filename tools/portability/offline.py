"""Compiling a kernel by clang alone, without a driver: as OpenCL C 1.2, for three targets.

spir64 and spir are what drivers take over from front ends, with pointers of 64 and 32 bits; there
it is the language that counts. gfx1100 is AMD's RDNA 3: its code shows registers and memory.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import NamedTuple

from portability.variants import Variant
from rift_cl.cl.build.source import kernel_source

TARGETS = ("spir64", "spir", "gfx1100")
# The version whose registers the table holds; another allocates them in another way.
CLANG = "clang-19"
_BUILTINS = Path("/usr/lib/clc/gfx1100-amdgcn-mesa-mesa3d.bc")
# Faults that these warnings were seen to tell of; others are matters of style.
_WARNINGS = ("shadow", "conditional-uninitialized", "bitwise-conditional-parentheses")
_FRONT_END = ("-x", "cl", "-cl-std=CL1.2", "-cl-mad-enable", "-Wno-everything", "-Werror")
_RESOURCES = {
    "vgprs": r"\bVGPRs: (\d+)",
    "scratch": r"ScratchSize \[bytes/lane\]: (\d+)",
    "local": r"LDS Size \[bytes/block\]: (\d+)",
    "occupancy": r"Occupancy \[waves/SIMD\]: (\d+)",
}


class Resources(NamedTuple):
    """What a kernel takes of a GPU.

    Args:
        vgprs: vector registers of a work-item.
        scratch: bytes of memory for registers that do not fit, for each work-item.
        local: bytes of local memory for each group.
        occupancy: waves that a unit can hold at a time, 16 at most.
    """

    vgprs: int
    scratch: int
    local: int
    occupancy: int


class Compiled(NamedTuple):
    """What came of compiling: resources where the target shows them, or the fault.

    Args:
        variant: that was compiled.
        target: for which.
        fault: the compiler's first words; empty where it compiled.
        resources: on gfx1100.
    """

    variant: Variant
    target: str
    fault: str = ""
    resources: Resources | None = None


def why_not() -> str:
    """What is missing for compiling, in a sentence; empty where nothing is."""
    if shutil.which(CLANG) is None:
        return f"{CLANG} is not installed (Debian: apt-get install clang-19 libclc-19)"
    return "" if _BUILTINS.is_file() else f"{_BUILTINS} is absent (apt-get install libclc-19)"


def compile_for(variant: Variant, target: str) -> Compiled:
    """Compile a variant for a target; of a GPU, only what is built for GPUs makes sense."""
    command = [CLANG, *_FRONT_END, *(f"-W{name}" for name in _WARNINGS), *_options(target)]
    done = subprocess.run(
        [*command, *variant.defines, "-", "-o", "/dev/null"],
        input=kernel_source(variant.kernel),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        faults = [line for line in done.stderr.splitlines() if "error:" in line]
        return Compiled(variant, target, (faults or [f"exit status {done.returncode}"])[0])
    if target != "gfx1100":
        return Compiled(variant, target)
    found = {name: re.search(text, done.stderr) for name, text in _RESOURCES.items()}
    absent = [name for name, match in found.items() if match is None]
    if absent:
        return Compiled(variant, target, f"{CLANG} does not tell {', '.join(absent)}")
    numbers = {name: int(match[1]) for name, match in found.items() if match}
    return Compiled(variant, target, "", Resources(**numbers))


@cache
def _options(target: str) -> tuple[str, ...]:
    header = ("-Xclang", "-finclude-default-header")
    if target != "gfx1100":
        return (*header, "-target", target, "-fsyntax-only")
    return (
        *(*header, "-target", "amdgcn-mesa-mesa3d", "-mcpu=gfx1100", "-nogpulib", "-O3", "-S"),
        *("-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(_BUILTINS)),
        "-Rpass-analysis=kernel-resource-usage",
    )
