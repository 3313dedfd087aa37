"""A kernel's first launch, told so that another process can repeat it.

Some drivers compile a kernel again when it is first launched, for the groups that it is launched
in, and their compiler may die then as well. Whoever launches writes down beforehand what he is
about to do; if he dies of it, the next process has a child do the same before it does.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

# A launch as JSON holds it: its grid, and of each argument the bytes of a number as text, the size
# of a buffer, or null for none.
FirstLaunch = dict[str, Any]


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
    import numpy as np

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


def repeat_launch(kernel: Any, context: Any, launch: FirstLaunch) -> None:
    """Launch a kernel as another process did, on buffers that hold zeros, and wait for it.

    Args:
        kernel: the ``pyopencl.Kernel``.
        context: of one device.
        launch: what ``told_launch`` told.

    Raises:
        pyopencl.Error: the driver refused it; not where there is no memory for the buffers, so that
            nothing can be found out.
        LookupError, TypeError, ValueError: it is not what ``told_launch`` told.
    """
    import numpy as np
    import pyopencl as cl

    queue = cl.CommandQueue(context)
    buffers = []
    for place, told in enumerate(launch["arguments"]):
        if isinstance(told, str):
            kernel.set_arg(place, np.frombuffer(bytes.fromhex(told), np.uint8))
            continue
        value = None
        if told is not None:
            try:
                value = cl.Buffer(context, cl.mem_flags.READ_WRITE, told)
                cl.enqueue_fill_buffer(queue, value, np.uint8(0), 0, told).wait()
            except (cl.MemoryError, MemoryError):
                return
            buffers.append(value)
        kernel.set_arg(place, value)
    cl.enqueue_nd_range_kernel(queue, kernel, launch["size"], launch["local"], launch["offset"])
    queue.finish()
