"""Compiling a kernel by clang alone, without a driver: as OpenCL C 1.2, for three targets.

spir64 and spir are what drivers take over from front ends, with pointers of 64 and 32 bits; there
it is the language that counts. gfx1100 is AMD's RDNA 3: its code shows registers and memory. For
NVIDIA's sm_80 clang writes PTX, of which NVIDIA's ptxas, where it is installed, makes machine code.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
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
    "sgprs": r"\bSGPRs: (\d+)",
    "spilled": r"VGPRs Spill: (\d+)",
}
_PTX = "sm_80"
_PTX_BUILTINS = Path("/usr/lib/clc/nvptx64--nvidiacl.bc")
# What clang's built-ins for NVIDIA lack; its driver has one instruction for each of the first two.
_PTX_LACKS = """
#define ONE_INSTRUCTION(name, code) \\
  static float name(float x) { \\
    float y; \\
    __asm__(code " %0, %1;" : "=f"(y) : "f"(x)); \\
    return y; \\
  }
ONE_INSTRUCTION(ptx_exp2, "ex2.approx.ftz.f32")
ONE_INSTRUCTION(ptx_sqrt, "sqrt.approx.ftz.f32")
#define native_exp2 ptx_exp2
#define native_sqrt ptx_sqrt
#define get_global_offset(axis) 0
"""


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


class PtxResources(NamedTuple):
    """What a kernel takes of a GPU of NVIDIA's.

    Args:
        registers: of a work-item.
        spilled: bytes that a work-item writes of registers that do not fit.
        local: bytes of local memory for each group.
    """

    registers: int
    spilled: int
    local: int


class Compiled(NamedTuple):
    """What came of compiling: resources where the target shows them, or the fault.

    Args:
        variant: that was compiled.
        target: for which.
        fault: the compiler's first words; empty where it compiled.
        resources: on gfx1100.
        sgprs: there, the registers that the items of a wave share.
        spilled: there, vector registers that do not fit.
    """

    variant: Variant
    target: str
    fault: str = ""
    resources: Resources | None = None
    sgprs: int = 0
    spilled: int = 0


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
    more = [numbers.pop(name) for name in ("sgprs", "spilled")]
    return Compiled(variant, target, "", Resources(**numbers), *more)


def compile_by_ptxas(variant: Variant) -> PtxResources | None:
    """What a variant takes of NVIDIA's sm_80; None where ptxas or clang's built-ins are absent.

    Raises:
        RuntimeError: it does not compile.
    """
    if shutil.which("ptxas") is None or not _PTX_BUILTINS.is_file():
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "kernel.ptx")
        command = [CLANG, *_FRONT_END, *_ptx_options(), *variant.defines, "-", "-o", str(path)]
        _run(command, _PTX_LACKS + kernel_source(variant.kernel))
        said = _run(["ptxas", "-v", f"-arch={_PTX}", str(path), "-o", os.devnull])
    found = (r"Used (\d+) registers", r"(\d+) bytes spill stores", r"(\d+) bytes smem")
    matches = (re.search(text, said) for text in found)
    return PtxResources(*(int(match[1]) if match else 0 for match in matches))


def _run(command: list[str], text: str = "") -> str:
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr.strip().splitlines()[:1]}")
    return done.stderr


def _ptx_options() -> tuple[str, ...]:
    return (
        *("-Xclang", "-finclude-default-header", "-target", "nvptx64-nvidia-nvcl", "-nogpulib"),
        *("-Xclang", "-target-cpu", "-Xclang", _PTX, "-Xclang", "-target-feature"),
        *("-Xclang", "+ptx70", "-mllvm", "-nvptx-prec-divf32=1", "-O3", "-S"),
        *("-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(_PTX_BUILTINS)),
    )


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
