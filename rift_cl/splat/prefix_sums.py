"""Prefix sums of whole numbers on the device, and into how many pieces a list is cut for it.

Sums go up and down a pyramid: ``kernels/vector/scan_sum_cpu.cl`` and ``scan_place_cpu.cl`` are one
step each way, where a work-item goes through a run of the list; on a GPU it is a group
(``scan_sum_gpu.cl``, ``scan_place_gpu.cl``).
"""

from __future__ import annotations

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

# A CPU's cores take so many chunks each, which evens their loads, of at least so many elements,
# below which starting a kernel costs more than running it.
_CPU_CHUNKS, _CPU_LEAST = 4, 16384
# Numbers that one group of a GPU scans, by so many items, and how many it scans alone: two launches
# less, and no group has to wait for others.
_GPU_RUN, _GPU_GROUP, _GPU_ALONE = 4096, 256, 16384

# For each level of the pyramid: the run that it sums up, and its sums.
Levels = list[tuple[int, DeviceArray]]


def for_kind(device: Device, kernel: str) -> str:
    """The name of the kernel that does a thing on this kind of device."""
    return f"{kernel}_{'cpu' if device.traits.is_cpu else 'gpu'}"


def run_length(device: Device, count: int, *, gpu: int) -> int:
    """Elements that one work-item goes through: a core's share on a CPU, ``gpu`` on a GPU."""
    if not device.traits.is_cpu:
        return gpu
    return max(_CPU_LEAST, pieces(count, _CPU_CHUNKS * device.traits.compute_units))


def pieces(count: int, size: int) -> int:
    """Number of pieces of a size that hold ``count`` elements, at least one."""
    return max(1, -(-count // size))


def scan_levels(device: Device, most: int) -> Levels:
    """Levels of a scan of at most ``most`` numbers: run lengths and buffers for their sums."""
    run = run_length(device, most, gpu=_GPU_RUN)
    sums = device.empty(pieces(most, run), np.int64)
    return [(run, sums), *(scan_levels(device, sums.size) if sums.size > 1 else [])]


def exclusive_scan(
    device: Device, values: DeviceArray, count: int, levels: Levels, *, wide: bool = False
) -> DeviceArray:
    """Replace int32 numbers (``wide``: int64) by the sum of all before.

    Returns:
        An int64 array whose first number is the total; the next scan with these levels takes it.
    """
    (run, sums), *above = levels
    group = 1 if device.traits.is_cpu else _GPU_GROUP
    if group > 1 and count <= _GPU_ALONE:
        run = count
    runs, total = pieces(count, run), sums
    scanning = {"values": values, "sums": sums, "count": count, "run": run, "WIDE": wide}
    if group > 1:
        scanning["GROUP"] = group
    if runs > 1:
        device.launch(for_kind(device, "scan_sum"), (runs * group,), **scanning)
        total = exclusive_scan(device, sums, runs, above, wide=True)
    device.launch(for_kind(device, "scan_place"), (runs * group,), **scanning, WHOLE=runs == 1)
    return total
