"""Where the arrays of a method are kept: on a device, or beside it where they do not fit.

Arrays beside it are NumPy's. Where the device has memory of its own and the host has room, they are
in the host's memory; else they are temporary files (in ``TMPDIR``) that are mapped into it, so that
the system keeps of them what there is room for. Where that folder is itself in memory they may take
no more than the host's budget. What is done to them (``axpby``, ``dot`` and the like, and
every operator that takes host arrays) is done in parts.
"""

from __future__ import annotations

import math
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rift_cl.cl.budget import format_bytes, host_budget
from rift_cl.cl.host_arrays import download, is_device_array
from rift_cl.cl.passing_parts import runs
from rift_cl.errors import ResourceLimitError

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

Shape = tuple[int, ...]
# What temporary files may take of the free room on their disk.
_DISK_SHARE = 0.9
# Types of file systems that are in memory.
_IN_MEMORY = ("tmpfs", "ramfs")


class ArrayHome:
    """Makes arrays of one type in one place.

    Args:
        device: the device.
        dtype: float32 or float64.
        beside: bytes of all arrays together that are to be kept beside the device; None: on it.

    Raises:
        ResourceLimitError: there is no room for them in the folder of temporary files.
    """

    def __init__(self, device: Device, dtype: DTypeLike, beside: int | None = None) -> None:
        self.device, self.dtype = device, np.dtype(dtype)
        self.on_device = beside is None
        """Whether arrays are on the device."""
        self._in_files = beside is not None and _wants_files(device, beside)

    def empty(self, shape: Shape) -> Any:
        """A new array, its contents not set."""
        if self.on_device:
            return self.device.empty(shape, self.dtype)
        return mapped_file(shape, self.dtype) if self._in_files else np.empty(shape, self.dtype)

    def zeros(self, shape: Shape) -> Any:
        """A new array of zeros."""
        if self.on_device:
            return self.device.zeros(shape, self.dtype)
        # A new file reads as zeros.
        return self.empty(shape) if self._in_files else np.zeros(shape, self.dtype)

    def array(self, values: ArrayLike) -> Any:
        """A new array of values on the host."""
        if self.on_device:
            return self.device.array(values, self.dtype)
        values = np.asarray(values)
        made = self.empty(values.shape)
        made[...] = values
        return made

    def made(self, shape: Shape, make: Callable[[Shape], NDArray[Any]]) -> Any:
        """A new array whose values come from ``make``, run after run or all at once."""
        if self.on_device:
            return self.device.array(make(shape), self.dtype)
        made = self.empty(shape)
        flat = made.reshape(-1)
        for run in runs(flat.size):
            flat[run] = make(flat[run].shape)
        return made

    def host(self, x: Any) -> NDArray[Any]:
        """The array on the host; the array itself where it is there."""
        return download(self.device, x) if is_device_array(x) else x


def mapped_file(shape: Shape, dtype: DTypeLike) -> NDArray[Any]:
    """An array of zeros in a temporary file that goes when the array does.

    Raises:
        ResourceLimitError: the folder of temporary files has no room for it.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size == 0:
        return np.zeros(shape, dtype)
    try:
        with tempfile.TemporaryFile(prefix="rift-") as file:
            # A disk that is full when a mapped page is written ends the process.
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            return np.asarray(np.memmap(file, dtype, "r+", shape=shape))
    except OSError as failure:
        raise ResourceLimitError(_no_room(size, failure.strerror)) from failure


def _wants_files(device: Device, size: int) -> bool:
    """Whether arrays that the device has no room for find none in the host's memory either.

    Raises:
        ResourceLimitError: there is none for files.
    """
    if not (device.traits.is_cpu or device.traits.unified) and size <= host_budget():
        return False
    try:
        folder = tempfile.gettempdir()
        room = _DISK_SHARE * shutil.disk_usage(folder).free
    except OSError as failure:
        raise ResourceLimitError(_no_room(size, failure.strerror)) from failure
    if _is_memory(folder) and host_budget() < room:
        room, why = host_budget(), "files there are in memory"
    else:
        why = f"{format_bytes(room)} are free for them"
    if size > room:
        raise ResourceLimitError(_no_room(size, why))
    return True


def _is_memory(folder: str) -> bool:
    """Whether files of a folder are kept in the host's memory, as Linux tells."""
    try:
        mounts = Path("/proc/mounts").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    place = Path(folder).resolve()
    # Later mounts hide earlier ones at the same place.
    kinds = {where: kind for _, where, kind, *_ in map(str.split, mounts.splitlines())}
    around = map(str, (place, *place.parents))
    return next((kinds[each] for each in around if each in kinds), "") in _IN_MEMORY


def _no_room(size: int, why: str | None) -> str:
    where = tempfile.tempdir or "any folder that is usual for them"
    return (
        f"{format_bytes(size)} of arrays that fit no memory have no room in temporary files in "
        f"{where} ({why or 'which cannot be written'}): name a folder with more room (TMPDIR), "
        "raise the memory budget (RIFT_MEMORY or --memory), or make the problem smaller"
    )
