"""Do the kernels run right on a driver that is not installed? One command for each.

    python tools/try_driver.py pocl                  # PoCL of the system's distribution
    python tools/try_driver.py pocl --suite trixie   # PoCL 6 of Debian 13, on an older system too
    python tools/try_driver.py rusticl --suite trixie --as-gpu  # Mesa: no doubles, 32 KiB local
    python tools/try_driver.py oclgrind --as-gpu --only sums tomography
    python tools/try_driver.py clspv                 # compiles for Vulkan (Android), runs nothing
    python tools/try_driver.py ocloc                 # compiles for Intel's Arc, runs nothing

The first four unpack Debian packages into a folder, without root and beside the system, and
compare families of kernels with PoCL's wheel as `compare_drivers.py` does. Oclgrind interprets each
instruction and tells of races and accesses out of bounds; any such report fails. For clspv
`pip install pyclspv` is needed; what it compiles is checked by spirv-val, which is unpacked, as
ocloc is. Intel's driver for CPUs: `pip install '.[intel]'`, then
`python tools/compare_drivers.py --device intel`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import tyro

from portability.unpacked import UnpackError, library_folders, python_under, unpack
from portability.variants import Variant, variants
from rift_cl.cl.build.source import kernel_source

_TOOLS = Path(__file__).parent
_FAULTS = re.compile(
    r"[^\n]*data race[^\n]*|Invalid (?:read|write)[^\n]*|[^\n]*exceeds static array[^\n]*",
    re.IGNORECASE,
)
_CLSPV = """
import sys, pyclspv
program = pyclspv.compile(sys.stdin.read())
sys.stdout.buffer.write(program)
sys.exit(not program)
"""
# What the SPIR-V is checked for, and which of Intel's GPUs is compiled for.
_VULKAN, _ARC = "vulkan1.1", "dg2"


class _Driver(NamedTuple):
    """A driver in a Debian package.

    Args:
        package: that brings it.
        library: pattern of the driver's library within the package.
        environment: that it wants.
        files: that it looks for in one place of the system alone.
    """

    package: str
    library: str
    environment: dict[str, str]
    files: tuple[str, ...] = ()


_DRIVERS = {
    "pocl": _Driver("pocl-opencl-icd", "libpocl.so.2*", {}),
    "rusticl": _Driver(
        "mesa-opencl-icd",
        "libRusticlOpenCL.so.1",
        {"RUSTICL_ENABLE": "llvmpipe"},
        ("usr/lib/clc/spirv-mesa3d-.spv", "usr/lib/clc/spirv64-mesa3d-.spv"),
    ),
    "oclgrind": _Driver(
        "oclgrind",
        "liboclgrind-rt-icd.so",
        {"OCLGRIND_DATA_RACES": "1", "OCLGRIND_CHECK_API": "1"},
    ),
}


@dataclass(frozen=True)
class Options:
    """Unpack a driver and compare families of kernels on it with PoCL's wheel, or compile alone.

    Args:
        driver: which one.
        suite: of Debian, such as trixie, that a driver is taken from; the system's if not given.
        folder: where packages are unpacked, and found again by the next run.
        only: families to run; all if not given. Of what compiles alone, kernels.
        as_gpu: one lane, groups of 64.
        full: families in full size; these drivers are slow.
        limit: seconds without a result, after which a family is given up.
    """

    driver: tyro.conf.Positional[Literal["pocl", "rusticl", "oclgrind", "clspv", "ocloc"]]
    suite: str = ""
    folder: Path = field(default_factory=lambda: Path(tempfile.gettempdir(), "rift-cl-drivers"))
    only: tuple[str, ...] = ()
    as_gpu: bool = False
    full: bool = False
    limit: float = 600.0


def main(options: Options) -> int:
    """Try the driver; the exit status."""
    try:
        if options.driver == "clspv":
            root = unpack("spirv-tools", options.folder.absolute())
            return _compile_all(options, lambda variant: _clspv_fault(variant, root))
        if options.driver == "ocloc":
            root = unpack("intel-opencl-icd", options.folder.absolute())
            return _compile_all(options, lambda variant: _ocloc_fault(variant, root))
        return _run(options)
    except (UnpackError, OSError) as error:
        print(f"try_driver: {error}", file=sys.stderr)
        return 2


def _run(options: Options) -> int:
    """Compare families on a driver that is not installed; the exit status."""
    driver = _DRIVERS[options.driver]
    python, own = _environment(driver, options.folder, options.suite)
    environment = {**os.environ, **own}
    _check_device(driver, python, environment)
    chosen = ["--limit", str(options.limit), *([] if options.full else ["--tiny"])]
    chosen += ["--only", *options.only] if options.only else []
    compare = [str(_TOOLS / "compare_drivers.py"), *chosen]
    kept = options.folder / "pocl.npz"
    saved = subprocess.run(
        [sys.executable, *compare, "--device", "pocl", "--save", str(kept)], check=False
    )
    if saved.returncode:
        return saved.returncode
    kind = ["--as-gpu"] if options.as_gpu else []
    # Its own loader entry comes first; PoCL's wheel is always there too.
    command = [python, *compare, "--device", "0:0", "--against", str(kept), *kind]
    status = subprocess.run(command, env=environment, check=False).returncode
    log = Path(environment.get("OCLGRIND_LOG", os.devnull))
    faults = sorted(set(_FAULTS.findall(log.read_text(errors="replace")))) if log.exists() else []
    for fault in faults:
        print(fault)
    return status or int(bool(faults))


def _environment(driver: _Driver, folder: Path, suite: str = "") -> tuple[str, dict[str, str]]:
    """The Python that runs on a driver, and what leads the loader to it and it to its libraries."""
    root = unpack(driver.package, folder.absolute(), suite)
    found = sorted(root.rglob(driver.library))
    if not found:
        raise UnpackError(f"package {driver.package} brings no {driver.library} here")
    absent = [name for name in driver.files if not Path("/", name).exists()]
    if absent and (root / absent[0]).exists():
        links = " ".join(str(root / name) for name in absent)
        raise UnpackError(
            f"{driver.package} looks for /{absent[0]} alone, which is not there: as root, run "
            f"'ln -s {links} {Path('/', absent[0]).parent}/'"
        )
    vendors = root / "vendors"
    vendors.mkdir(exist_ok=True)
    (vendors / "driver.icd").write_text(f"{found[0]}\n")
    # A cache of its own: two versions of PoCL take each other's kernels for damaged.
    own = {
        "OCL_ICD_VENDORS": str(vendors),
        "RIFT_CACHE_DIR": str(root.with_name(f"{root.name}-cache")),
    }
    if driver.package == "oclgrind":
        log = root / "oclgrind.log"
        log.unlink(missing_ok=True)
        own["OCLGRIND_LOG"] = str(log)
    python = sys.executable
    if suite:
        python = str(python_under(root))
        own["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    else:
        own["LD_LIBRARY_PATH"] = _libraries(root)
    return python, {**driver.environment, **own}


def _libraries(root: Path) -> str:
    return os.pathsep.join([*library_folders(root), os.environ.get("LD_LIBRARY_PATH", "")])


def _check_device(driver: _Driver, python: str, environment: dict[str, str]) -> None:
    """See that there is a device besides that of PoCL's wheel, which would pass in its place."""
    command = [python, "-c", "import rift_cl; print(len(rift_cl.devices()))"]
    found = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if found.stdout.strip() in ("", "0", "1"):
        raise UnpackError(f"the driver of {driver.package} shows no device here")


def _compile_all(options: Options, fault_of: Callable[[Variant], str]) -> int:
    """Compile every variant for GPUs in float; the exit status."""
    known = [
        variant
        for variant in variants(options.only)
        if variant.kind == "gpu" and "DOUBLE=1" not in variant.macros
    ]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        faults = [fault for fault in pool.map(fault_of, known) if fault]
    print(*faults, f"{options.driver}: {len(known)} variants, {len(faults)} faults", sep="\n")
    return int(bool(faults))


def _clspv_fault(variant: Variant, root: Path) -> str:
    """What clspv, which may die and has a process of its own, or spirv-val says of a variant."""
    lines = [f"#define {define[2:].replace('=', ' ', 1)}" for define in variant.defines]
    source = "\n".join([*lines, kernel_source(variant.kernel)])
    done = subprocess.run(
        [sys.executable, "-c", _CLSPV], input=source.encode(), capture_output=True, check=False
    )
    if done.returncode:
        return _told(variant, done)
    valid = next(root.rglob("spirv-val"))
    checked = subprocess.run(
        [str(valid), "--target-env", _VULKAN, "-"],
        input=done.stdout,
        env={**os.environ, "LD_LIBRARY_PATH": _libraries(root)},
        capture_output=True,
        check=False,
    )
    return _told(variant, checked) if checked.returncode else ""


def _ocloc_fault(variant: Variant, root: Path) -> str:
    """What Intel's compiler for GPUs says against a variant."""
    program = next(root.rglob("bin/ocloc"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"{variant.kernel}.cl")
        path.write_text(kernel_source(variant.kernel), encoding="utf-8")
        options = " ".join(("-cl-std=CL1.2", "-cl-mad-enable", *variant.defines))
        done = subprocess.run(
            [str(program), "compile", "-file", str(path), "-device", _ARC, "-options", options,
             "-out_dir", folder],
            env={**os.environ, "LD_LIBRARY_PATH": _libraries(root)},
            capture_output=True,
            check=False,
        )  # fmt: skip
    return _told(variant, done) if done.returncode else ""


def _told(variant: Variant, done: subprocess.CompletedProcess[bytes]) -> str:
    lines = (done.stderr + done.stdout).decode(errors="replace").splitlines()
    told = [line for line in lines if "rror" in line]
    return f"{variant}: {told[0] if told else f'exit status {done.returncode}'}"


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options)))
