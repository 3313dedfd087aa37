"""A device that is ready for work: context, queue, programs, memory.

Everything is enqueued on one in-order queue, so that results do not depend on timing. A device is
pickled as the selector that opens it: contexts do not travel, names do.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rift_cl.cl.array import AnyArray, DeviceArray
from rift_cl.cl.budget import check_array, memory_budget
from rift_cl.cl.build.driver_record import OTHER_KIND, driver_identity, read_record
from rift_cl.cl.failures import driver_errors, named_error, named_errors
from rift_cl.cl.heap import Heap
from rift_cl.cl.host_arrays import as_plain, as_real_array, download, send, upload
from rift_cl.cl.process import claim_process
from rift_cl.cl.program import Programs
from rift_cl.cl.traits import Traits

# Asking how much memory the host has free costs more than a smaller array is worth.
_LARGE = 1 << 20
# Shapes of arrays that are remembered.
_SHAPES = 256


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
        self.traits = traits or _traits_of(handle)
        self._limit = memory
        self._handle = handle
        self._opened: _Opened | None = None
        self._opening = threading.Lock()
        self._programs = Programs(self)

    def __repr__(self) -> str:
        """The selector and the name, as ``rift devices`` prints them."""
        return f"<Device {self.selector} {self.name} ({self.platform})>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as the selector; the receiving process opens its own context."""
        from rift_cl.cl.discovery import reopened

        return reopened, (self.selector, self._limit)

    @property
    def kind(self) -> str:
        """``CPU``, ``GPU``, or ``accelerator`` for what is neither."""
        import pyopencl as cl

        if self.traits.is_cpu:
            return "CPU"
        # A CPU in the guise of a GPU (``traits``) is one.
        gpu = self._handle.type & (cl.device_type.GPU | cl.device_type.CPU)
        return "GPU" if gpu else "accelerator"

    @property
    def in_other_guise(self) -> bool:
        """Whether it is taken for a GPU where it is a CPU, or the reverse."""
        return self.traits.is_cpu != Traits.of(self._handle).is_cpu

    @property
    def identity(self) -> dict[str, str]:
        """What tells this device and its driver from any other; see ``driver_record``."""
        return driver_identity(self._handle)

    @property
    def keeps_programs(self) -> bool:
        """Whether its driver keeps what it compiles in our cache folder."""
        return self._programs.keeps_programs

    @property
    def kernels(self) -> list[str]:
        """The names of the kernels that were built or loaded for it so far."""
        return self._programs.kernels

    @property
    def context(self) -> Any:
        """The ``pyopencl.Context``."""
        return self._open().context

    @property
    def queue(self) -> Any:
        """The one in-order ``pyopencl.CommandQueue``."""
        return self._open().queue

    def _open(self) -> _Opened:
        """What this device works with, opened by its first user: threads must share one context.

        Raises:
            ForkedContextError: OpenCL was used before this process was forked.
        """
        claim_process()
        if self._opened is not None:
            return self._opened
        with self._opening:
            if self._opened is None:
                with named_errors("opening it", self.name):
                    self._opened = _Opened.of(self._handle, self.traits)
            return self._opened

    @property
    def budget(self) -> int:
        """Bytes that may be used on this device now."""
        return memory_budget(self.traits, self._limit)

    def empty(self, shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> DeviceArray:
        """A new ``pyopencl.array.Array`` whose contents are not set.

        Raises:
            ResourceLimitError: it is larger than the device takes in one piece.
            DeviceMemoryError: the device's memory ran out.
        """
        opened = self._open()
        array: Any = opened.plain_array(shape, dtype)
        if array.nbytes:
            self._allocate(opened, array)
        made: DeviceArray = array
        return made

    def _allocate(self, opened: _Opened, array: Any) -> None:
        """Give an array memory."""
        wanted, shape = array.nbytes, array.shape
        self.check_array(wanted, shape)
        # Blocks that are kept for the next array count as well, until the room is needed.
        room = self.budget if wanted >= _LARGE else self._limit or self.traits.usable_memory
        if opened.managed_bytes + wanted > room:
            opened.free_held()
        array.allocator = opened.allocator(wanted, self.traits.allocation)
        try:
            array.base_data = array.allocator(wanted)
        except driver_errors() as error:
            doing = f"allocating an array of shape {shape}"
            raise named_error(error, doing, self.name) from error

    def check_array(self, size: int, shape: int | tuple[int, ...]) -> None:
        """Refuse an array that this device does not take in one piece.

        Raises:
            ResourceLimitError: its ``size`` in bytes is larger than the device's largest buffer.
        """
        if size > self.traits.allocation:
            what = f"an array of shape {shape} on {self.name}"
            check_array(size, self.traits.allocation, what=what)

    def zeros(self, shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> DeviceArray:
        """A new device array of zeros."""
        import pyopencl as cl

        array = self.empty(shape, dtype)
        if array.nbytes:
            with named_errors("clearing an array", self.name):
                cl.enqueue_fill_buffer(self.queue, array.base_data, np.uint8(0), 0, array.nbytes)
        return array

    def array(self, host: ArrayLike, dtype: DTypeLike | None = None) -> DeviceArray:
        """Copy a host array to the device.

        Args:
            host: anything NumPy reads as an array of real numbers.
            dtype: the type it shall have there; if not given, integers stay as they are and other
                numbers become float32.

        Raises:
            DTypeError: the values are not real numbers.
        """
        values = as_real_array(host, name="array")
        native = np.float32 if values.dtype.kind in "fb" else values.dtype.newbyteorder("=")
        return upload(self, as_plain(values, native if dtype is None else dtype))

    def send(self, host: NDArray[np.float32]) -> DeviceArray:
        """As ``array``, for float32 in C order, without waiting for what was enqueued before."""
        return send(self, host)

    def get(self, array: AnyArray) -> NDArray[Any]:
        """A copy on the host of an array, which may be there already."""
        return array.copy() if isinstance(array, np.ndarray) else download(self, array)

    def launch(self, kernel: str, work: tuple[int, ...], /, **given: Any) -> None:
        """Enqueue a kernel over ``work`` items, as in ``launch("axpby", (n,), x=x, .., RUN=1)``.

        Arguments have the names that the kernel's source gives them, compile-time constants are in
        capitals; see ``Programs.launch``.
        """
        self._programs.launch(kernel, work, given)

    def finish(self) -> None:
        """Wait until everything enqueued is done."""
        queue = self.queue
        with named_errors("finishing its work", self.name):
            queue.finish()

    def release(self) -> None:
        """Give memory that no array uses any more back to the driver."""
        self._open().free_held()

    @property
    def taken(self) -> int:
        """Bytes that it has from the driver for arrays, kept ones included."""
        return self._open().managed_bytes


def _traits_of(handle: Any) -> Traits:
    """The traits of a device, in the guise of the other kind where its driver's test took that."""
    traits = Traits.of(handle)
    other = read_record(driver_identity(handle)).get("way") == OTHER_KIND
    return dataclasses.replace(traits, is_cpu=not traits.is_cpu) if other else traits


class _Opened(NamedTuple):
    """What is made once a device is needed.

    Args:
        context: the ``pyopencl.Context``.
        queue: the ``pyopencl.CommandQueue``.
        pool: memory for arrays, which keeps what they leave for the next ones.
        heap: that for large arrays, where the device is a CPU; otherwise None, as GPUs may ask for
            more of parts of buffers than is known here.
        direct: memory for arrays, from the driver.
        plain_array: a new array without memory, by shape and type.
    """

    context: Any
    queue: Any
    pool: Any
    heap: Heap | None
    direct: Any
    plain_array: Callable[..., Any]

    @property
    def managed_bytes(self) -> int:
        """Bytes that there are for arrays, in use and kept."""
        return int(self.pool.managed_bytes) + (self.heap.managed_bytes if self.heap else 0)

    def free_held(self) -> None:
        """Give back what is kept."""
        self.pool.free_held()
        if self.heap is not None:
            self.heap.free_held()

    def allocator(self, size: int, largest: int) -> Any:
        """What makes a buffer of ``size`` bytes: the pool, unless its own would be too large.

        Buffers of the pool are up to a sixteenth larger than what is asked for.
        """
        if self.heap is not None and size >= _LARGE and self.heap.fits(size, largest):
            return self.heap
        fits = size <= largest // 2 or self.pool.alloc_size(self.pool.bin_number(size)) <= largest
        return self.pool if fits else self.direct

    @classmethod
    def of(cls, handle: Any, traits: Traits) -> _Opened:
        import pyopencl as cl
        from pyopencl.array import Array
        from pyopencl.tools import ImmediateAllocator, MemoryPool

        context = cl.Context([handle])
        queue = cl.CommandQueue(context)
        direct = ImmediateAllocator(queue)

        def looked_at(shape: int | tuple[int, ...], dtype: DTypeLike) -> dict[str, Any]:
            array = Array(queue, shape, dtype, allocator=lambda size: None)
            assert array.flags.c_contiguous  # The flags are kept with it.
            members: dict[str, Any] = vars(array)
            return members

        # A step of a fit makes some fifty arrays, mostly of the shapes of the step before, and what
        # pyopencl looks at for each of them takes longer than to launch a kernel.
        known: Callable[..., dict[str, Any]] = lru_cache(_SHAPES)(looked_at)

        def plain_array(shape: int | tuple[int, ...], dtype: DTypeLike) -> Any:
            array = Array.__new__(Array)
            array.__dict__.update(known(shape, dtype), events=[])
            return array

        heap = Heap(direct) if traits.is_cpu else None
        return cls(context, queue, MemoryPool(direct), heap, direct, plain_array)
