"""Intel's OpenCL driver for CPUs as pip installs it, made known to the loader.

The wheel ``intel-opencl-rt`` brings the driver and a file that should lead a loader to it, but that
file names a folder of whoever made the wheel. So we write one into our cache folder and name that
folder to the loader, beside the drivers of the system. PoCL's wheel needs nothing of this kind.
"""

from __future__ import annotations

import hashlib
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from rift_cl.cl.build.kernel_cache import cache_folder

_WHEEL = "intel-opencl-rt"
_LINUX, _WINDOWS = "libintelocl.so", "intelocl64.dll"
_SYSTEM = Path("/etc/OpenCL/vendors")
# What makes a loader look elsewhere; whoever sets one of them has chosen.
_CHOICES = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH", "OCL_ICD_FILENAMES")


def register_intel_runtime() -> None:
    """Let the loader find Intel's driver where its wheel is installed; call before it loads.

    Nothing is done where an environment variable names drivers, or where no file can be written.
    The driver opens no device from a folder with a space in its path (seen with 2026.22 on Linux),
    a link to it or not; it is left out there, with a warning.
    """
    library = _library()
    if library is None or any(os.environ.get(name) for name in _CHOICES):
        return
    if " " in str(library) and sys.platform != "win32":
        warnings.warn(
            f"Intel's driver in {library.parent} is left out: it opens no device from a folder "
            "with a space in its path; install the extra intel in an environment without one",
            stacklevel=2,
        )
        return
    if sys.platform == "win32":
        # The loader of Windows takes libraries by name beside those of the registry.
        os.environ["OCL_ICD_FILENAMES"] = str(library)
        return
    with suppress(OSError):
        os.environ["OCL_ICD_VENDORS"] = str(_vendors(library))


def renew_intel_runtime() -> None:
    """Write the folder again where the cache was cleared since; call before a child looks there."""
    folder, library = os.environ.get("OCL_ICD_VENDORS", ""), _library()
    ours = library is not None and Path(folder).name == _environment(library)
    if library is not None and ours and not Path(folder).is_dir():
        with suppress(OSError):
            _vendors(library)


def _library() -> Path | None:
    """The driver's library in the wheel, if that is installed."""
    try:
        files = distribution(_WHEEL).files or ()
    except PackageNotFoundError:
        return None
    wanted = _WINDOWS if sys.platform == "win32" else _LINUX
    found = (Path(str(file.locate())).resolve() for file in files if file.name == wanted)
    return next((path for path in found if path.is_file()), None)


def _environment(library: Path) -> str:
    """What the folder is called: environments that share the cache have each their own driver."""
    return hashlib.sha256(str(library).encode()).hexdigest()[:16]


def _vendors(library: Path) -> Path:
    """A folder that leads a loader to this library and to what the system has."""
    folder = cache_folder() / "vendors" / _environment(library)
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    wanted = dict(_of_the_system()) | {"rift-intel.icd": f"{library}\n"}
    for old in folder.iterdir():
        if old.name not in wanted:
            old.unlink(missing_ok=True)
    for name, text in wanted.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            # Another process may read it now: it is there whole or not at all.
            part = path.with_suffix(f".part{os.getpid()}")
            part.write_text(text, encoding="utf-8")
            part.replace(path)
    return folder


def _of_the_system() -> Iterator[tuple[str, str]]:
    for path in sorted(_SYSTEM.glob("*.icd")):
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError):
            continue
        # One driver that is listed twice would be two devices.
        if _LINUX not in text:
            yield path.name, text
