"""What a driver's error codes mean to a person: the one place that names them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from rift_cl.cl.watchdog import in_driver
from rift_cl.errors import (
    DeviceError,
    DeviceLostError,
    DeviceMemoryError,
    ResourceLimitError,
    RiftError,
)

_MEMORY = ("MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_RESOURCES", "OUT_OF_HOST_MEMORY")
_SIZE = "INVALID_BUFFER_SIZE"
_LOST = ("DEVICE_NOT_AVAILABLE", "INVALID_COMMAND_QUEUE", "INVALID_CONTEXT")


@contextlib.contextmanager
def named_errors(doing: str, device: str) -> Iterator[None]:
    """Turn a driver's exception into one of ours; see ``named_error`` for the arguments.

    Raises:
        DeviceMemoryError: the driver ran out of memory.
        ResourceLimitError: it takes no single array of that size.
        DeviceLostError: the device went away.
        DeviceError: any other failure of the driver.
    """
    try:
        with in_driver(doing, device):
            yield
    except driver_errors() as error:
        raise named_error(error, doing, device) from error


def driver_errors() -> tuple[type[Exception], ...]:
    """What a driver's failure is raised as; an ``except`` asks only when something was raised."""
    import pyopencl as cl

    return cl.Error, MemoryError


def is_out_of_memory(error: Exception) -> bool:
    """Whether a driver's failure is one of memory, its own or the computer's."""
    return isinstance(error, MemoryError) or any(code in str(error) for code in _MEMORY)


def named_error(error: Exception, doing: str, device: str) -> RiftError:
    """What a driver's failure means.

    Args:
        error: what the driver raised.
        doing: what was being done, to stand in the sentence.
        device: the device's name.
    """
    text = str(error)
    if is_out_of_memory(error):
        return DeviceMemoryError(
            f"{device} ran out of memory while {doing} ({text}): give it less at a time, for "
            "example a smaller memory budget (RIFT_MEMORY or --memory)"
        )
    if _SIZE in text:
        return ResourceLimitError(
            f"{device} takes no single array of the size that it was asked for while {doing} "
            f"({text}): work on parts of it, or make the problem smaller"
        )
    if any(code in text for code in _LOST):
        return DeviceLostError(
            f"{device} went away while {doing} ({text}): what was on the device is lost, "
            "what was saved is not; start again from the last saved result"
        )
    return DeviceError(f"{device} failed while {doing}: {text}")
