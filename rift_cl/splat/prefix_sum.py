"""Prefix sums on the device, and how a list is cut among work-items.

A scan goes up and down a pyramid of sums; ``kernels/vector/scan_sum.cl`` and ``scan_place.cl`` are
one step each way. Integers are exact, so the result does not depend on how the list was cut.
"""

from __future__ import annotations

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

# A CPU's cores take so many chunks each, which evens their loads, of at least so many elements,
# below which starting a kernel costs more than running it.
_CPU_CHUNKS, _CPU_LEAST = 4, 4096
# A GPU's work-items are many: each takes so few elements of a list.
GPU_RUN = 64

# For each level of the pyramid: the run that it sums up, and its sums.
Levels = list[tuple[int, DeviceArray]]


def run_length(device: Device, count: int, *, gpu: int) -> int:
    """Elements that one work-item goes through: a core's share on a CPU, ``gpu`` on a GPU."""
    if not device.traits.is_cpu:
        return gpu
    return max(_CPU_LEAST, pieces(count, _CPU_CHUNKS * device.traits.compute_units))


def pieces(count: int, size: int) -> int:
    """Pieces of this size that hold so many elements; one piece where there are none."""
    return max(1, -(-count // size))


def scan_levels(device: Device, most: int) -> Levels:
    """For scans of at most so many numbers: each level's run and room for the sums of its runs."""
    run = run_length(device, most, gpu=GPU_RUN)
    sums = device.empty(pieces(most, run), np.int64)
    return [(run, sums), *(scan_levels(device, sums.size) if sums.size > 1 else [])]


def exclusive_scan(
    device: Device, values: DeviceArray, count: int, levels: Levels, *, wide: bool = False
) -> DeviceArray:
    """Replace int32 numbers (``wide``: int64) by the sum of all before; (1,) int64, the total."""
    (run, sums), *above = levels
    runs = pieces(count, run)
    total = sums[:1]
    scanning = {"values": values, "sums": sums, "count": count, "run": run}
    if runs > 1:
        device.launch("scan_sum", (runs,), **scanning, WIDE=wide)
        total = exclusive_scan(device, sums, runs, above, wide=True)
    device.launch("scan_place", (runs,), **scanning, WIDE=wide, WHOLE=runs == 1)
    return total
