"""What is known of a driver, kept beside the compiled kernels: it is found out but once.

A driver is known by everything that tells it from another: two of one name differ in their
version, and a new version is a new driver. What cannot be kept is found out again by the next run.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from pathlib import Path
from typing import Any

from rift_cl import __version__
from rift_cl.cl.build.cache_check import files_kept, own_file
from rift_cl.cl.build.kernel_cache import build_lock, cache_folder
from rift_cl.cl.build.program_store import write_whole
from rift_cl.json_parsing import parse_json

# The way of a driver that is right with kernels for GPUs on a CPU alone, or the reverse.
OTHER_KIND = "kernels of the other kind of device"
_FORMAT = 1
# A program that no cache can hold: its code is new each time (PoCL looks past comments).
_PROBE = "__kernel void probe(__global uint *p) {{ p[get_global_id(0)] = 0x{}u; }}"


def driver_identity(handle: Any) -> dict[str, str]:
    """What tells a device and its driver from any other, from a ``pyopencl.Device``."""
    return {
        "platform": handle.platform.name.strip(),
        "platform version": handle.platform.version.strip(),
        "device": handle.name.strip(),
        "device version": handle.version.strip(),
        "driver": handle.driver_version.strip(),
    }


def read_record(driver: dict[str, str]) -> dict[str, Any]:
    """What is known of a driver; empty where nothing is, or what was kept cannot be read."""
    try:
        record = parse_json(own_file(_path(driver)).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    wanted = {"format": _FORMAT, "rift_cl": __version__, "driver": driver}
    known = isinstance(record, dict) and wanted.items() <= record.items()
    return record if known else {}


def add_to_record(driver: dict[str, str], **facts: Any) -> None:
    """Keep what was found out of a driver."""
    record = {**read_record(driver), "format": _FORMAT, "rift_cl": __version__, "driver": driver}
    with contextlib.suppress(OSError):
        write_whole(_path(driver), json.dumps({**record, **facts}, indent=1).encode())


def forget_record(driver: dict[str, str]) -> None:
    """Forget a driver: it is met anew."""
    with contextlib.suppress(OSError):
        _path(driver).unlink(missing_ok=True)


def keeps_programs(driver: dict[str, str], context: Any) -> bool:
    """Whether a driver keeps what it compiles in our cache folder, so that we need not.

    A program that it never saw is built, and it is seen whether that leaves a file there.
    """
    import pyopencl as cl

    kept = read_record(driver).get("keeps programs")
    if isinstance(kept, bool):
        return kept
    with build_lock():
        before = files_kept(cache_folder())
        try:
            cl.Program(context, _PROBE.format(os.urandom(4).hex())).build()
        except cl.Error:
            return False
        kept = files_kept(cache_folder()) > before
    add_to_record(driver, **{"keeps programs": kept})
    return kept


def _path(driver: dict[str, str]) -> Path:
    name = hashlib.sha256(json.dumps(driver, sort_keys=True).encode()).hexdigest()
    return cache_folder() / "drivers" / f"{name[:32]}.json"
