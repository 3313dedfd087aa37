"""What a device is like, read once: every decision that depends on the device is made from here.

A device opened with other traits works within them, so that every limit can be met on any machine:
``Device(handle, selector, traits=dataclasses.replace(device.traits, allocation=1 << 16))``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from typing import Any

POCL = "Portable Computing Language"
# Work-items of a group of a GPU, where it takes so many.
_GROUP = 64
# Rows of a table of splats that a work-item of a CPU goes through, eight at a time.
_RUN = 64
# Work-items of one launch. More than 2^31 along x are left out by some drivers without a word, and
# groups of a GPU are numbered by 16 bits along y and z on some. A further launch costs nothing.
_ALONG_X, _FURTHER = 1 << 31, 65535
# What a GPU with memory of its own keeps for its driver and for the screen.
_OWN_SHARE = 0.85
# Systems that end what keeps a GPU busy for two seconds, and the longest launch that is safe there.
_WATCHED, _WATCHED_SECONDS = ("win32", "darwin"), 1.0


@dataclass(frozen=True)
class Traits:
    """The facts about a device that our kernels and drivers depend on.

    Args:
        is_cpu: one work-item per row segment with explicit vectors, in place of a group of many.
        pocl: the driver is PoCL, whose built-in functions are slow calls (see ``portable.h``).
        unified: host memory is device memory, so that arrays can be shared without a copy.
        fp64: double precision is there.
        compute_units: as reported.
        memory: bytes of device memory, as reported.
        allocation: largest single buffer in bytes, as reported.
        local_memory: bytes of local memory, as reported.
        group: largest work-group along its first axis, as reported.
        address_bits: of a pointer on the device; memory beyond what they reach is not used.
        share: the part of ``memory`` that we may use.
        items: most work-items of one launch along x, y and z; larger grids are launched in parts.
        seconds: longest time that one launch may take where the system ends those that take longer,
            and with them the program's use of the device; launches are cut by it. None where
            nothing does that.
        optimized: whether the compiler optimizes. It takes most of its time for that, more than a
            kernel that is launched once or twice is worth.
    """

    is_cpu: bool
    pocl: bool
    unified: bool
    fp64: bool
    compute_units: int
    memory: int
    allocation: int
    local_memory: int
    group: int
    address_bits: int = 64
    share: float = 1.0
    items: tuple[int, int, int] = (_ALONG_X, _FURTHER, _FURTHER)
    seconds: float | None = None
    optimized: bool = True

    @classmethod
    def of(cls, device: Any) -> Traits:
        """Read the traits of a ``pyopencl.Device``."""
        import pyopencl as cl

        is_cpu = bool(device.type & cl.device_type.CPU)
        unified = bool(device.host_unified_memory)
        return cls(
            is_cpu=is_cpu,
            pocl=device.platform.name == POCL,
            unified=unified,
            fp64="cl_khr_fp64" in device.extensions.split(),
            compute_units=device.max_compute_units,
            memory=device.global_mem_size,
            allocation=device.max_mem_alloc_size,
            local_memory=device.local_mem_size,
            group=min(device.max_work_group_size, device.max_work_item_sizes[0]),
            address_bits=device.address_bits,
            share=1.0 if is_cpu or unified else _OWN_SHARE,
            seconds=None if is_cpu else _watched_seconds(device),
        )

    @cached_property
    def usable_memory(self) -> int:
        """Bytes of device memory that we may use."""
        return min(int(self.share * self.memory), 1 << self.address_bits)

    @property
    def run(self) -> int:
        """Splats that one work-item goes through: see ``kernels/include/splat/splat_rows.h``."""
        return _RUN if self.is_cpu else 1

    def runs(self, count: int) -> int:
        """Work-items that go through ``count`` splats."""
        return -(-count // self.run)

    @property
    def macros(self) -> dict[str, int]:
        """What every kernel is told: see ``kernels/include/portable.h``."""
        return {
            "RIFT_POCL": int(self.pocl),
            "LANES": 8 if self.is_cpu else 1,
            "GROUP": 1 if self.is_cpu else smaller_group(min(_GROUP, self.group)),
        }


def smaller_group(most: int) -> int:
    """The largest power of two up to ``most``, which is what kernels take for a group."""
    return 1 << (max(most, 1).bit_length() - 1)


def _watched_seconds(device: Any) -> float | None:
    """Longest launch that the system of a GPU lets run to its end.

    NVIDIA's driver says whether somebody watches (a GPU without a screen is not watched); of
    others the operating system decides.
    """
    watched = sys.platform in _WATCHED
    if "cl_nv_device_attribute_query" in device.extensions.split():
        watched = bool(device.kernel_exec_timeout_nv)
    return _WATCHED_SECONDS if watched else None
