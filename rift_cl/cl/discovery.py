"""Which OpenCL devices there are, and which one to use.

``RIFT_DEVICE`` or ``--device`` selects one by its number in the list (``1``), by platform and
device (``0:1``), by kind (``cpu``, ``gpu``, ``accelerator``) or by a part of its name or its
platform's (``radeon``, ``pocl``). Without a choice the first GPU is taken; where there is none the
first CPU, by PoCL if that is there; what is neither (an FPGA or its emulator) comes last.
"""

from __future__ import annotations

import os
import threading
import warnings
from functools import cache
from typing import Any

from rift_cl.cl.build.intel_runtime import register_intel_runtime
from rift_cl.cl.build.kernel_cache import prepare_cache
from rift_cl.cl.device import Device
from rift_cl.cl.process import claim_process
from rift_cl.errors import ForkedContextError, NoDeviceError

_INSTALL = (
    "install a driver: your GPU vendor's OpenCL package, or on Linux x86-64 a CPU driver from "
    "PyPI with: pip install 'pyopencl[pocl]'"
)
# Variables by which drivers and their loader leave devices out.
_HIDING = (
    *("POCL_DEVICES", "OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "OPENCL_VENDOR_PATH"),
    *("CUDA_VISIBLE_DEVICES", "GPU_DEVICE_ORDINAL", "ROCR_VISIBLE_DEVICES", "ZE_AFFINITY_MASK"),
)
_enumerating = threading.Lock()
_RANKS = ("GPU", "CPU", "accelerator")
# A driver that calls itself by a long name is asked for by the short one.
_NICKNAMES = {"pocl": "portable computing language"}


def devices() -> tuple[Device, ...]:
    """Every device of every OpenCL platform; empty where there is none.

    Raises:
        ForkedContextError: OpenCL was used before this process was forked.
    """
    claim_process()
    # Threads that ask at the same time must be given the same devices, or they cannot share arrays.
    with _enumerating:
        return _found()


@cache
def _found() -> tuple[Device, ...]:
    prepare_cache()
    register_intel_runtime()
    import pyopencl as cl

    try:
        platforms = cl.get_platforms()
    except cl.Error:
        return ()
    return tuple(d for number, platform in enumerate(platforms) for d in _of(number, platform))


def _of(number: int, platform: Any) -> list[Device]:
    import pyopencl as cl

    try:
        handles = platform.get_devices()
        return [Device(handle, f"{number}:{index}") for index, handle in enumerate(handles)]
    except cl.Error:
        # A driver that cannot answer must not hide the others.
        return []


def _hidden() -> str:
    """What may hide devices that are there, for a sentence; empty if nothing does."""
    found = [f"{name}={os.environ[name]}" for name in _HIDING if name in os.environ]
    return f"unset {', '.join(found)}, which may hide what is there, or " if found else ""


def open_device(selector: str | None = None, memory: int | None = None) -> Device:
    """Choose a device.

    Args:
        selector: which one (see the head of this file); ``RIFT_DEVICE`` when not given, and a
            sensible order when that is not set either.
        memory: most bytes to use on it.

    Raises:
        NoDeviceError: there is no device, or none that fits the selector.
    """
    found = devices()
    if not found:
        raise NoDeviceError(f"no OpenCL device was found: {_hidden()}{_INSTALL}")
    selector = selector or os.environ.get("RIFT_DEVICE")
    fitting = _fitting(found, selector) if selector else by_rank()
    if not fitting:
        known = ", ".join(f"{d.selector} {d.name} ({d.platform})" for d in found)
        raise NoDeviceError(f"no OpenCL device fits {selector!r}; there is: {known}")
    chosen = fitting[0]
    if selector:
        _tell_namesakes(fitting, selector)
    if memory is None:
        return chosen
    return Device(chosen._handle, chosen.selector, memory=memory)


def reopened(selector: str, memory: int | None) -> Device:
    """The device that pickle sent to this process.

    A process that was forked, in which no device can be opened, is given the one that it inherited,
    and is told of it by whatever it does with that. Told of it here, a worker of
    ``multiprocessing.Pool`` would end, and whoever waits for its result would wait for ever.

    Raises:
        NoDeviceError: this process has no such device.
    """
    try:
        return open_device(selector, memory)
    except ForkedContextError:
        inherited = _found() if _found.cache_info().currsize else ()
        for device in inherited:
            if device.selector == selector:
                return device
        raise


def alike_devices(device: Device, selector: str | None = None) -> list[Device]:
    """The devices of one name and driver that a selector fits, such as the GPUs of a machine.

    Args:
        device: one of them, as ``open_device`` gives it.
        selector: as ``open_device`` takes it.
    """
    selector = selector or os.environ.get("RIFT_DEVICE")
    found = _fitting(devices(), selector) if selector else list(devices())
    return [d for d in found if d.identity == device.identity]


def by_rank() -> list[Device]:
    """The devices in the order in which they are preferred: GPUs, CPUs (PoCL's first), others.

    Another driver for the CPU that is installed later changes no result.
    """
    return sorted(devices(), key=lambda device: (_RANKS.index(device.kind), not device.traits.pocl))


def default_device() -> Device:
    """The device that is used where none is named (``RIFT_DEVICE`` selects another)."""
    return open_device()


def _fitting(found: tuple[Device, ...], selector: str) -> list[Device]:
    return [device for number, device in enumerate(found) if _fits(device, number, selector)]


def _tell_namesakes(fitting: list[Device], selector: str) -> None:
    """Warn where a name fits two drivers of that name, of which the first is taken."""
    first, *others = fitting
    alike = [
        d
        for d in others
        if (d.name, d.platform) == (first.name, first.platform) and d.driver != first.driver
    ]
    if alike:
        known = ", ".join(f"{d.selector} (driver {d.driver})" for d in (first, *alike))
        warnings.warn(
            f"{selector!r} fits {len(alike) + 1} devices named {first.name} ({first.platform}): "
            f"{known}; the first is taken, '{alike[0].selector}' selects the next",
            stacklevel=3,
        )


def _fits(device: Device, number: int, selector: str) -> bool:
    wanted = selector.strip().lower()
    if wanted in (str(number), device.selector):
        return True
    if wanted in map(str.lower, _RANKS):
        return device.kind.lower() == wanted
    if not any(letter.isalpha() for letter in wanted):
        return False
    wanted = _NICKNAMES.get(wanted, wanted)
    return wanted in f"{device.name} {device.platform}".lower()
