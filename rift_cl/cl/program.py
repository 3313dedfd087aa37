"""Launching kernels.

A ``cl.Kernel`` object holds its arguments, so two threads that share one silently compute with each
other's; each thread keeps its own. Arguments are named, and checked against what the kernel's
source says that it takes.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rift_cl.cl.build import Builder, Key, building
from rift_cl.cl.failures import named_errors
from rift_cl.cl.kernel_cache import build_lock
from rift_cl.cl.process import claim_process
from rift_cl.cl.signature import Parameter, check_names, check_numbers, in_order, parameters
from rift_cl.cl.source import kernel_source

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

# PoCL compiles for grids up to this size and for larger ones apart.
_SMALL_GRID = 65534


class _Kernel(NamedTuple):
    """A kernel object of one thread, and what the kernel takes."""

    handle: Any
    parameters: tuple[Parameter, ...]


class _ThreadKernels(threading.local):
    """The calling thread's own kernel objects."""

    def __init__(self) -> None:
        self.kernels: dict[Key, _Kernel] = {}


class Programs:
    """Every thread's kernels on one device.

    Args:
        device: the device to launch on.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._builder = Builder(device)
        self._started: set[tuple[Key, bool]] = set()
        # The macros among the names that launches give, for each set of names that was given.
        self._macros: dict[tuple[str, ...], tuple[str, ...]] = {}
        self._own = _ThreadKernels()

    @property
    def kernels(self) -> list[str]:
        """The names of the kernels that were built or loaded so far."""
        return self._builder.kernels

    def launch(self, name: str, size: tuple[int, ...], given: dict[str, Any]) -> None:
        """Enqueue one kernel over ``size`` work-items; the first axis is rounded up to groups.

        Args:
            name: the kernel, which is also its file and its entry point.
            size: work-items along each axis; nothing is enqueued when one is zero.
            given: what the kernel is given, by name. Names in capitals are the compile-time
                constants that this variant is built with. All others are the kernel's arguments,
                as its source names them: device arrays for buffers, numbers for numbers, NumPy
                arrays of 4 for ``float4``. None is no buffer, and may also be given for an
                argument that this variant does not take.

        Raises:
            KernelArgumentError: an argument is missing, unknown, or of another type than the
                kernel wants.
            DeviceError: ``DOUBLE`` is 1 and the device has no doubles, or the driver failed.
        """
        claim_process()
        if 0 in size:
            return
        names = tuple(given)
        macros = self._macros.get(names)
        if macros is None:
            macros = self._macros[names] = tuple(sorted(filter(str.isupper, names)))
        key = (name, tuple([(macro, literal(given[macro])) for macro in macros]))
        kernel = self._kernel(key)
        if len(given) != len(macros) + len(kernel.parameters):
            check_names(name, kernel.parameters, given)
        values = in_order(name, kernel.parameters, given)
        group = self._device.traits.macros["GROUP"]
        rounded = (-(-size[0] // group) * group, *size[1:])
        local = (group,) + (1,) * (len(size) - 1)
        with named_errors(f"running {name}", self._device.name):
            try:
                kernel.handle.set_args(*values)
            except RuntimeError:
                check_numbers(name, kernel.parameters, values)
                raise
            self._enqueue((key, max(size) > _SMALL_GRID), kernel.handle, rounded, local)

    def _enqueue(
        self,
        started: tuple[Key, bool],
        kernel: Any,
        size: tuple[int, ...],
        local: tuple[int, ...],
    ) -> None:
        import pyopencl as cl

        queue = self._device.queue
        if started in self._started:
            cl.enqueue_nd_range_kernel(queue, kernel, size, local)
            return
        # PoCL compiles again for the first launch, into the same cache.
        with building, build_lock():
            cl.enqueue_nd_range_kernel(queue, kernel, size, local)
            queue.finish()
            self._started.add(started)

    def _kernel(self, key: Key) -> _Kernel:
        kernel = self._own.kernels.get(key)
        if kernel is None:
            import pyopencl as cl

            name, macros = key
            program = self._builder.program(key)
            with building, named_errors(f"loading kernel {name}", self._device.name):
                handle = cl.Kernel(program, name)
                found = parameters(name, kernel_source(name), self._builder.defines(macros))
                # Numbers whose types are known beforehand are set many times faster.
                handle.set_scalar_arg_dtypes(
                    [each.dtype.type if each.lanes == 1 else None for each in found]
                )
            kernel = self._own.kernels[key] = _Kernel(handle, found)
        return kernel


def literal(value: float | str) -> str:
    """A compile-time constant as the compiler sees it; a text is an expression without spaces."""
    if isinstance(value, str):
        return value
    return f"{float(value)!r}f" if isinstance(value, (float, np.floating)) else str(int(value))
