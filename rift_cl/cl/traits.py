"""What a device is like, read once: every decision that depends on the device is made from here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

POCL = "Portable Computing Language"


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
        group: largest work-group, as reported.
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

    @classmethod
    def of(cls, device: Any) -> Traits:
        """Read the traits of a ``pyopencl.Device``."""
        import pyopencl as cl

        return cls(
            is_cpu=bool(device.type & cl.device_type.CPU),
            pocl=device.platform.name == POCL,
            unified=bool(device.host_unified_memory),
            fp64="cl_khr_fp64" in device.extensions.split(),
            compute_units=device.max_compute_units,
            memory=device.global_mem_size,
            allocation=device.max_mem_alloc_size,
            local_memory=device.local_mem_size,
            group=device.max_work_group_size,
        )

    @property
    def macros(self) -> dict[str, int]:
        """What every kernel is told: see ``kernels/include/portable.h``."""
        return {
            "RIFT_POCL": int(self.pocl),
            "LANES": 8 if self.is_cpu else 1,
            "GROUP": 1 if self.is_cpu else 64,
        }
