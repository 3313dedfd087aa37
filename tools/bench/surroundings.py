"""Where and when a benchmark ran: what a figure means nothing without."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import rift_cl as rift

_OURS = ("numpy", "scipy", "pyopencl")
_PEERS = ("astra-toolbox", "itk-rtk", "silx", "gratopy", "scikit-image", "torch", "gsplat")
_PACKAGES = (*_OURS, *_PEERS)
_IMPORTS = 5


def surroundings(device: rift.Device) -> dict[str, Any]:
    """Version, date, device, host and packages, for the head of the JSON file."""
    return {
        "version": rift.__version__,
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "device": {
            "name": device.name,
            "platform": device.platform,
            "driver": device.driver,
            "selector": device.selector,
            "is_cpu": device.traits.is_cpu,
            "compute_units": device.traits.compute_units,
        },
        "host": {
            "cpu": _cpu_model(),
            "cores": os.cpu_count(),
            "system": platform.system(),
            "python": platform.python_version(),
        },
        "import_s": import_seconds(),
        "packages": {name: found for name in _PACKAGES if (found := _installed(name))},
    }


def in_words(where: Mapping[str, Any]) -> str:
    """The sentences of a page that name version, device, host and date, from ``surroundings``."""
    device, host = where["device"], where["host"]
    return (
        f"rift_cl {where['version']} on **{device['name']}** ({device['platform']}, driver "
        f"{device['driver']}); host {host['cpu']}, {host['cores']} cores. {where['date']}."
    )


def import_seconds() -> float:
    """Seconds that ``import rift_cl`` and a first look at a grid take in a fresh process."""
    code = (
        "import time; start = time.perf_counter(); import rift_cl; rift_cl.Grid((2, 2)); "
        "print(time.perf_counter() - start)"
    )
    times = []
    for _ in range(_IMPORTS):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        times.append(float(done.stdout))
    return min(times)


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def _installed(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
