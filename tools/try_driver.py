"""Do the kernels run right on a driver that is not installed? One command for each.

    python tools/try_driver.py pocl                  # PoCL of the system's distribution
    python tools/try_driver.py rusticl --as-gpu      # Mesa on llvmpipe: no doubles, 32 KiB local
    python tools/try_driver.py oclgrind --as-gpu --only sums tomography
    python tools/try_driver.py clspv                 # compiles for Vulkan (Android), runs nothing

The first three unpack Debian packages into a folder, without root and beside the system, and
compare families of kernels with PoCL's wheel as `compare_drivers.py` does. Oclgrind interprets each
instruction and tells of races and accesses out of bounds; any such report fails. For clspv
`pip install pyclspv` is needed. Intel's driver: `pip install '.[intel]'`, then
`python tools/compare_drivers.py --device intel`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import tyro

from portability.unpacked import UnpackError, unpack
from portability.variants import Variant, variants
from rift_cl.cl.build.source import kernel_source

_TOOLS = Path(__file__).parent
_FAULTS = re.compile(
    r"[^\n]*data race[^\n]*|Invalid (?:read|write)[^\n]*|[^\n]*exceeds static array[^\n]*",
    re.IGNORECASE,
)
_CLSPV = "import sys, pyclspv; sys.exit(not pyclspv.compile(sys.stdin.read()))"


class _Driver(NamedTuple):
    """A driver in a Debian package.

    Args:
        package: that brings it.
        library: pattern of the driver's library within the package.
        environment: that it wants.
    """

    package: str
    library: str
    environment: dict[str, str]


_DRIVERS = {
    "pocl": _Driver("pocl-opencl-icd", "libpocl.so.2", {}),
    "rusticl": _Driver("mesa-opencl-icd", "libRusticlOpenCL.so.1", {"RUSTICL_ENABLE": "llvmpipe"}),
    "oclgrind": _Driver(
        "oclgrind",
        "liboclgrind-rt-icd.so",
        {"OCLGRIND_DATA_RACES": "1", "OCLGRIND_CHECK_API": "1"},
    ),
}


@dataclass(frozen=True)
class Options:
    """Unpack a driver and compare families of kernels on it with PoCL's wheel.

    Args:
        driver: which one.
        folder: where packages are unpacked, and found again by the next run.
        only: families to run; all if not given. For clspv, kernels.
        as_gpu: one lane, groups of 64.
        full: families in full size; these drivers are slow.
        limit: seconds without a result, after which a family is given up.
    """

    driver: tyro.conf.Positional[Literal["pocl", "rusticl", "oclgrind", "clspv"]]
    folder: Path = field(default_factory=lambda: Path(tempfile.gettempdir(), "rift-cl-drivers"))
    only: tuple[str, ...] = ()
    as_gpu: bool = False
    full: bool = False
    limit: float = 600.0


def main(options: Options) -> int:
    """Try the driver; the exit status."""
    if options.driver == "clspv":
        return _compile_by_clspv(options.only)
    driver = _DRIVERS[options.driver]
    try:
        environment = {**os.environ, **_environment(driver, options.folder)}
        _check_device(driver, environment)
    except (UnpackError, OSError) as error:
        print(f"try_driver: {error}", file=sys.stderr)
        return 2
    chosen = ["--limit", str(options.limit), *([] if options.full else ["--tiny"])]
    chosen += ["--only", *options.only] if options.only else []
    compare = [sys.executable, str(_TOOLS / "compare_drivers.py"), *chosen]
    kept = options.folder / "pocl.npz"
    saved = subprocess.run([*compare, "--device", "pocl", "--save", str(kept)], check=False)
    if saved.returncode:
        return saved.returncode
    kind = ["--as-gpu"] if options.as_gpu else []
    # Its own loader entry comes first; PoCL's wheel is always there too.
    command = [*compare, "--device", "0:0", "--against", str(kept), *kind]
    status = subprocess.run(command, env=environment, check=False).returncode
    log = Path(environment.get("OCLGRIND_LOG", os.devnull))
    faults = sorted(set(_FAULTS.findall(log.read_text(errors="replace")))) if log.exists() else []
    for fault in faults:
        print(fault)
    return status or int(bool(faults))


def _environment(driver: _Driver, folder: Path) -> dict[str, str]:
    """What leads the loader to the driver and the driver to its libraries."""
    root = unpack(driver.package, folder.absolute())
    found = sorted(root.rglob(driver.library))
    if not found:
        raise UnpackError(f"package {driver.package} brings no {driver.library} here")
    vendors = root / "vendors"
    vendors.mkdir(exist_ok=True)
    (vendors / "driver.icd").write_text(f"{found[0]}\n")
    folders = sorted({str(path.parent) for path in root.rglob("*.so*")})
    # A cache of its own: two versions of PoCL take each other's kernels for damaged.
    own = {"OCL_ICD_VENDORS": str(vendors), "RIFT_CACHE_DIR": str(root / "cache")}
    own["LD_LIBRARY_PATH"] = os.pathsep.join([*folders, os.environ.get("LD_LIBRARY_PATH", "")])
    if driver.package == "oclgrind":
        log = root / "oclgrind.log"
        log.unlink(missing_ok=True)
        own["OCLGRIND_LOG"] = str(log)
    return {**driver.environment, **own}


def _check_device(driver: _Driver, environment: dict[str, str]) -> None:
    """See that there is a device besides that of PoCL's wheel, which would pass in its place."""
    command = [sys.executable, "-c", "import rift_cl; print(len(rift_cl.devices()))"]
    found = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if found.stdout.strip() in ("", "0", "1"):
        raise UnpackError(f"the driver of {driver.package} shows no device here")


def _compile_by_clspv(kernels: tuple[str, ...]) -> int:
    """Compile every variant for GPUs; each in a process of its own, since clspv may die."""
    known = [
        variant
        for variant in variants(kernels)
        if variant.kind == "gpu" and "DOUBLE=1" not in variant.macros
    ]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        faults = [fault for fault in pool.map(_clspv_fault, known) if fault]
    print(*faults, sep="\n")
    print(f"clspv: {len(known)} variants, {len(faults)} faults")
    return int(bool(faults))


def _clspv_fault(variant: Variant) -> str:
    lines = [f"#define {define[2:].replace('=', ' ', 1)}" for define in variant.defines]
    done = subprocess.run(
        [sys.executable, "-c", _CLSPV],
        input="\n".join([*lines, kernel_source(variant.kernel)]),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 0:
        return ""
    told = [line for line in (done.stderr + done.stdout).splitlines() if "rror" in line]
    return f"{variant}: {told[0] if told else f'exit status {done.returncode}'}"


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options)))
