"""A device that is ready for work: context, queue, programs, memory.

Everything is enqueued on one in-order queue, so that results do not depend on timing. A device is
pickled as the selector that opens it: contexts do not travel, names do.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rift_cl.cl.budget import memory_budget
from rift_cl.cl.failures import named_errors
from rift_cl.cl.memory import download, upload
from rift_cl.cl.process import claim_process
from rift_cl.cl.program import Programs
from rift_cl.cl.traits import Traits
from rift_cl.errors import DTypeError


class Device:
    """One OpenCL device, opened.

    Args:
        handle: the ``pyopencl.Device``.
        selector: the text that opens this device again in another process.
        traits: what to take the device for; read from it when not given.
        memory: most bytes to use; see ``memory_budget``.
    """

    def __init__(
        self, handle: Any, selector: str, *, traits: Traits | None = None, memory: int | None = None
    ) -> None:
        self.name: str = handle.name.strip()
        self.platform: str = handle.platform.name.strip()
        self.driver: str = handle.driver_version.strip()
        self.selector = selector
        self.traits = traits or Traits.of(handle)
        self._limit = memory
        self._handle = handle
        self._programs = Programs(self)

    def __repr__(self) -> str:
        """The selector and the name, as ``rift devices`` prints them."""
        return f"<Device {self.selector} {self.name} ({self.platform})>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as the selector; the receiving process opens its own context."""
        from rift_cl.cl.discovery import open_device

        return open_device, (self.selector, self._limit)

    @cached_property
    def context(self) -> Any:
        """The ``pyopencl.Context``."""
        import pyopencl as cl

        claim_process()
        with named_errors("opening it", self.name):
            return cl.Context([self._handle])

    @cached_property
    def queue(self) -> Any:
        """The one in-order ``pyopencl.CommandQueue``."""
        import pyopencl as cl

        with named_errors("opening it", self.name):
            return cl.CommandQueue(self.context)

    @cached_property
    def _pool(self) -> Any:
        from pyopencl.tools import ImmediateAllocator, MemoryPool

        return MemoryPool(ImmediateAllocator(self.queue))

    @property
    def budget(self) -> int:
        """Bytes that may be used on this device now."""
        return memory_budget(self.traits, self._limit)

    def empty(self, shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> Any:
        """A new ``pyopencl.array.Array`` whose contents are not set."""
        from pyopencl.array import Array

        claim_process()
        with named_errors(f"allocating an array of shape {shape}", self.name):
            return Array(self.queue, shape, dtype, allocator=self._pool)

    def zeros(self, shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> Any:
        """A new device array of zeros."""
        import pyopencl as cl

        array = self.empty(shape, dtype)
        if array.nbytes:
            with named_errors("clearing an array", self.name):
                cl.enqueue_fill_buffer(self.queue, array.base_data, np.uint8(0), 0, array.nbytes)
        return array

    def array(self, host: ArrayLike) -> Any:
        """Copy a host array to the device: integers as they are, other numbers as float32.

        Raises:
            DTypeError: the values are not real numbers.
        """
        values = np.asarray(host)
        if values.dtype.kind not in "fiub":
            raise DTypeError(f"array has type {values.dtype}, wanted real numbers")
        if values.dtype.kind in "fb":
            values = values.astype(np.float32, copy=False)
        native = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("="))
        return upload(self, native.reshape(values.shape))

    def get(self, array: Any) -> NDArray[Any]:
        """Copy a device array to the host."""
        return download(self, array)

    def launch(self, kernel: str, size: tuple[int, ...], *arguments: Any, **macros: Any) -> None:
        """Enqueue a kernel over ``size`` work-items; see ``Programs.launch``."""
        self._programs.launch(kernel, size, arguments, macros)

    def finish(self) -> None:
        """Wait until everything enqueued is done."""
        with named_errors("finishing its work", self.name):
            self.queue.finish()

    def release(self) -> None:
        """Give memory that no array uses any more back to the driver."""
        self._pool.free_held()
