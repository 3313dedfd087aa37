"""Arithmetic on arrays that stay on the host: parts of them pass through the device.

What a device does not hold, for lack of memory or of so large a buffer, keeps its bits this way: a
part ends where the samples of a work-item do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from rift_cl.cl.host_arrays import download, share, upload

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

# Samples that one work-item of a CPU goes through in arithmetic on whole arrays.
CPU_RUN = 4096
# Samples of the host's own work on an array at a time.
_HOST_RUN = 1 << 22
# Parts that are on the device at a time, with those whose memory is not free again yet.
_AT_ONCE = 4


def most_samples(device: Device, each: int) -> int:
    """Samples of ``each`` bytes that a part may have, whole runs of them."""
    room = min(device.traits.allocation, device.budget // _AT_ONCE)
    return max(room // (each * CPU_RUN), 1) * CPU_RUN


def runs(size: int, most: int = _HOST_RUN) -> Iterator[slice]:
    """Runs of at most so many of ``size`` items, all but the last as long as that."""
    return (slice(first, min(first + most, size)) for first in range(0, size, most))


def pass_parts(device: Device, work: Callable[..., None], *arrays: NDArray[Any]) -> None:
    """Call ``work`` with device copies of the same part of each array, part after part.

    Args:
        device: what they pass through.
        work: takes as many device arrays; it changes the last one, which the host gets back.
        *arrays: C-ordered host arrays of one size and type.
    """
    flat = [array.reshape(-1) for array in arrays]
    most = most_samples(device, flat[-1].itemsize)
    for first in range(0, flat[-1].size, most):
        *read, target = (array[first : first + most] for array in flat)
        there = upload(device, target)
        work(*(share(device, part) for part in read), there)
        download(device, there, target)
