"""Building and launching kernels: the only caller of the driver's compiler.

A program is built once per device, kernel and macros. A ``cl.Kernel`` object holds its arguments,
so two threads that share one silently compute with each other's; each thread keeps its own.
"""

from __future__ import annotations

import re
import threading
import time
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rift_cl.cl.failures import named_errors
from rift_cl.cl.kernel_cache import build_lock
from rift_cl.cl.process import claim_process
from rift_cl.cl.real_type import real_type
from rift_cl.cl.source import kernel_source
from rift_cl.errors import KernelBuildError

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

OPTIONS = ("-cl-std=CL1.2", "-cl-mad-enable", "-w")
# PoCL compiles for grids up to this size and for larger ones apart.
_SMALL_GRID = 65534
_PAUSES = (0.0, 0.1, 0.3)
# One for all devices: pyopencl writes Python code for each new kernel, and that is not thread-safe.
_building = threading.RLock()
# A kernel and its macros as the compiler sees them: 1 and 1.0 are equal, but not the same.
_Key = tuple[str, tuple[tuple[str, str], ...]]
_DOUBLE = ("DOUBLE", "1")


class _ThreadKernels(threading.local):
    """The calling thread's own kernel objects."""

    def __init__(self) -> None:
        self.kernels: dict[_Key, Any] = {}
        self.typed: set[_Key] = set()


class Programs:
    """The built programs of one device and every thread's kernels.

    Args:
        device: the device to build for.
    """

    def __init__(self, device: Device) -> None:
        # Some drivers remark on kernels that they build well; a failure is told by an exception.
        warnings.filterwarnings("ignore", message="Non-empty compiler output")
        self._device = device
        self._programs: dict[_Key, Any] = {}
        self._started: set[tuple[_Key, bool]] = set()
        self._own = _ThreadKernels()

    def launch(
        self,
        name: str,
        size: tuple[int, ...],
        arguments: tuple[Any, ...],
        macros: Mapping[str, Any],
    ) -> None:
        """Enqueue one kernel over ``size`` work-items; the first axis is rounded up to groups.

        Args:
            name: the kernel, which is also its file and its entry point.
            size: work-items along each axis; nothing is enqueued when one is zero.
            arguments: device arrays, and Python ints and floats for ``int`` and ``real`` (which is
                ``float`` unless ``DOUBLE`` is 1); NumPy scalars for what is neither.
            macros: the compile-time constants that this variant is built with.

        Raises:
            DeviceError: ``DOUBLE`` is 1 and the device has no doubles, or the driver failed.
        """
        claim_process()
        if 0 in size:
            return
        key = (name, tuple(sorted((macro, _literal(value)) for macro, value in macros.items())))
        kernel = self._kernel(key)
        group = self._device.traits.macros["GROUP"]
        rounded = (-(-size[0] // group) * group, *size[1:])
        local = (group,) + (1,) * (len(size) - 1)
        with named_errors(f"running {name}", self._device.name):
            self._enqueue(key, kernel, rounded, local, arguments)

    def _enqueue(
        self, key: _Key, kernel: Any, size: tuple[int, ...], local: tuple[int, ...], values: Any
    ) -> None:
        import pyopencl as cl

        queue = self._device.queue
        if key not in self._own.typed:
            # Numbers whose types are known beforehand are set many times faster.
            real = np.float64 if _DOUBLE in key[1] else np.float32
            with _building:
                kernel.set_scalar_arg_dtypes([_scalar_type(value, real) for value in values])
            self._own.typed.add(key)
        kernel.set_args(*(_plain(value) for value in values))
        started = (key, max(size) > _SMALL_GRID)
        if started in self._started:
            cl.enqueue_nd_range_kernel(queue, kernel, size, local)
            return
        # PoCL compiles again for the first launch, into the same cache.
        with _building, build_lock():
            cl.enqueue_nd_range_kernel(queue, kernel, size, local)
            queue.finish()
            self._started.add(started)

    def _kernel(self, key: _Key) -> Any:
        if key not in self._own.kernels:
            import pyopencl as cl

            program = self._program(key)
            with _building, named_errors(f"loading kernel {key[0]}", self._device.name):
                self._own.kernels[key] = cl.Kernel(program, key[0])
        return self._own.kernels[key]

    def _program(self, key: _Key) -> Any:
        with _building:
            if key not in self._programs:
                self._programs[key] = self._build(key)
            return self._programs[key]

    def _build(self, key: _Key) -> Any:
        import pyopencl as cl

        name, macros = key
        if _DOUBLE in macros:
            real_type(self._device, np.float64)
        defines = {**self._device.traits.macros, **dict(macros)}
        options = [*OPTIONS, *(f"-D{macro}={value}" for macro, value in defines.items())]
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


def _scalar_type(value: Any, real: Any) -> Any:
    """The type of a number as the kernel takes it; None for what is no number."""
    if isinstance(value, int):
        return np.int32
    if isinstance(value, float):
        return real
    return value.dtype.type if isinstance(value, np.generic) else None


def _plain(value: Any) -> Any:
    return value.base_data if hasattr(value, "base_data") else value


def _literal(value: float) -> str:
    return f"{float(value)!r}f" if isinstance(value, (float, np.floating)) else str(int(value))


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
