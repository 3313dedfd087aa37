"""Building kernels: the only caller of the driver's compiler.

A program is built once per device, kernel and macros.
"""

from __future__ import annotations

import re
import threading
import time
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from rift_cl.cl.kernel_cache import build_lock
from rift_cl.cl.real_type import real_type
from rift_cl.cl.source import kernel_source
from rift_cl.errors import KernelBuildError

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

OPTIONS = ("-cl-std=CL1.2", "-cl-mad-enable", "-w")
# One for all devices: pyopencl writes Python code for each new kernel, and that is not thread-safe.
building = threading.RLock()
# A kernel and its macros as the compiler sees them: 1 and 1.0 are equal, but not the same.
Key = tuple[str, tuple[tuple[str, str], ...]]
_PAUSES = (0.0, 0.1, 0.3)
_DOUBLE = ("DOUBLE", "1")


class Builder:
    """The built programs of one device.

    Args:
        device: the device to build for.
    """

    def __init__(self, device: Device) -> None:
        # Some drivers remark on kernels that they build well; a failure is told by an exception.
        warnings.filterwarnings("ignore", message="Non-empty compiler output")
        self._device = device
        self._programs: dict[Key, Any] = {}

    def defines(self, macros: tuple[tuple[str, str], ...]) -> dict[str, str]:
        """Every macro that a program is built with."""
        device = {macro: str(value) for macro, value in self._device.traits.macros.items()}
        return device | dict(macros)

    def program(self, key: Key) -> Any:
        """The ``pyopencl.Program`` of a kernel and its macros, built by the first who asks.

        Raises:
            KernelBuildError: it does not compile.
            DeviceError: ``DOUBLE`` is 1 and the device has no doubles.
        """
        with building:
            if key not in self._programs:
                self._programs[key] = self._build(key)
            return self._programs[key]

    def _build(self, key: Key) -> Any:
        import pyopencl as cl

        name, macros = key
        if _DOUBLE in macros:
            real_type(self._device, np.float64)
        defines = self.defines(macros).items()
        options = [*OPTIONS, *(f"-D{macro}={value}" for macro, value in defines)]
        failure = ""
        for pause in _PAUSES:
            time.sleep(pause)
            try:
                with build_lock():
                    return cl.Program(self._device.context, kernel_source(name)).build(options)
            except cl.Error as error:
                failure = str(error)
            # An empty log is PoCL's way to lose a race for its cache; a real error has one.
            if _log(failure):
                break
        raise _build_error(name, failure, options, self._device.name)


def _log(text: str) -> str:
    lines = [line for line in text.splitlines() if re.search(r"error|warning", line, re.IGNORECASE)]
    return "\n".join(line for line in lines if "BUILD_PROGRAM_FAILURE" not in line)


def _build_error(name: str, text: str, options: list[str], device: str) -> KernelBuildError:
    log = _log(text)
    place = re.search(r"([\w./-]+\.(?:cl|h)):(\d+)", log)
    where = f"{place[1]}:{place[2]}" if place else f"{name}.cl"
    return KernelBuildError(
        f"kernel {name} did not compile for {device}, at {where}; this is a defect of rift-cl or "
        f"of the driver, please report it with this log (options {' '.join(options)}):\n"
        f"{log or text}"
    )
