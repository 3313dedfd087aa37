"""A kernel's first launch, told so that another process can repeat it.

Some drivers compile a kernel again when it is first launched, for the groups that it is launched
in, and their compiler may die then as well. So a child does the same before, over the smallest grid
that is compiled for alike. Whoever launches writes down beforehand what he is about to do, so that
the next process knows of it if he dies of it all the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

# A launch as JSON holds it: its grid, and of each argument the bytes of a number as text, the size
# of a buffer, or null for none.
FirstLaunch = dict[str, Any]
# Ways in which PoCL compiles a kernel apart: for a large grid, and for a part of a grid.
Way = tuple[bool, bool]
# It compiles for grids up to this size and for larger ones apart.
_SMALL_GRID = 65534
# Longest buffers, in bytes, that are filled with zeros for a CPU: glibc uses memory again up to
# this size. What is longer comes from the system as zeros, and takes none until somebody writes.
_FILLED = 1 << 25


def way_of(size: Sequence[int], offset: Sequence[int] | None) -> Way:
    """The way in which a kernel is compiled for a grid of ``size`` work-items at ``offset``."""
    return max(size) > _SMALL_GRID, offset is not None


def told_launch(
    size: Sequence[int],
    local: Sequence[int],
    offset: Sequence[int] | None,
    arguments: Iterable[tuple[Any, Any]],
) -> FirstLaunch:
    """A launch in terms that JSON can hold.

    Args:
        size: work-items along each axis.
        local: those of a group.
        offset: of the grid, or None.
        arguments: for each the type of a number (a NumPy dtype) or None, and the number, an array
            of numbers, or a buffer.
    """

    def told(dtype: Any, value: Any) -> str | int | None:
        if value is None:
            return None
        return int(value.size) if dtype is None else np.asarray(value, dtype).tobytes().hex()

    return {
        # Whoever launches may count in NumPy's integers, which JSON does not know.
        "size": list(map(int, size)),
        "local": list(map(int, local)),
        "offset": None if offset is None else list(map(int, offset)),
        "arguments": [told(*argument) for argument in arguments],
    }


def without_numbers(launch: FirstLaunch) -> FirstLaunch:
    """The same launch with every number 0."""
    told = (each if not isinstance(each, str) else "0" * len(each) for each in launch["arguments"])
    return {**launch, "arguments": list(told)}


def smallest_alike(size: Sequence[int], local: Sequence[int]) -> list[int]:
    """The smallest grid that a kernel is compiled for as for another: mostly one group."""
    smallest = list(local)
    if max(size) > _SMALL_GRID:
        longest = int(np.argmax(size))
        smallest[longest] *= _SMALL_GRID // local[longest] + 1
    return smallest


def repeat_launch(kernel: Any, context: Any, launch: FirstLaunch) -> None:
    """Launch a kernel as another process does, on buffers of zeros, and wait for it.

    The grid is the smallest that is compiled for alike: a large one may take long.

    Args:
        kernel: the ``pyopencl.Kernel``.
        context: of one device.
        launch: what ``told_launch`` told.

    Raises:
        pyopencl.Error: the driver refused it; not where there is no memory for the buffers, so that
            nothing can be found out.
        LookupError, TypeError, ValueError: it is not what ``told_launch`` told.
    """
    import pyopencl as cl

    queue = cl.CommandQueue(context)
    on_cpu = context.devices[0].type & cl.device_type.CPU
    buffers = []
    for place, told in enumerate(launch["arguments"]):
        if isinstance(told, str):
            kernel.set_arg(place, np.frombuffer(bytes.fromhex(told), np.uint8))
            continue
        value = None
        if told is not None:
            try:
                value = cl.Buffer(context, cl.mem_flags.READ_WRITE, told)
                if told <= _FILLED or not on_cpu:
                    cl.enqueue_fill_buffer(queue, value, np.uint8(0), 0, told).wait()
            except (cl.MemoryError, MemoryError):
                return
            buffers.append(value)
        kernel.set_arg(place, value)
    size = smallest_alike(launch["size"], launch["local"])
    cl.enqueue_nd_range_kernel(queue, kernel, size, launch["local"], launch["offset"])
    queue.finish()
