"""What solvers do to whole device arrays besides adding them: copy, weigh, clip, pull.

Sums and multiples are in ``rift_cl.cl.arithmetic``, inner products in ``rift_cl.cl.reductions``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rift_cl.cl.failures import named_errors

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

# Samples that one work-item of a CPU goes through.
_CPU_RUN = 4096


def copy(device: Device, x: Any, y: Any) -> None:
    """Y = x, whatever y held before."""
    import pyopencl as cl

    if x.nbytes:
        with named_errors("copying an array", device.name):
            cl.enqueue_copy(device.queue, y.base_data, x.base_data, byte_count=x.nbytes)


def multiply(device: Device, w: Any, y: Any) -> None:
    """Y = w y, sample by sample."""
    _launch(device, "multiply", (w, y))


def clip_negative(device: Device, y: Any) -> None:
    """Y = max(y, 0), sample by sample."""
    _launch(device, "clip_negative", (y,))


def clip_between(device: Device, low: Any, high: Any, y: Any) -> None:
    """Y = min(max(y, low), high), sample by sample."""
    _launch(device, "clip_between", (low, high, y))


def pull_to_levels(device: Device, levels: Any, strength: float, x: Any, y: Any) -> None:
    """Y += strength (m - x), m the middle of the two of the ascending levels about x."""
    _launch(device, "level_pull", (levels, levels.size, float(strength), x, y))


def _launch(device: Device, kernel: str, arrays: tuple[Any, ...]) -> None:
    y = arrays[-1]
    run = _CPU_RUN if device.traits.is_cpu else 1
    macros = {"RUN": run, "DOUBLE": int(y.dtype == np.float64)}
    device.launch(kernel, (-(-y.size // run),), *arrays, np.uint64(y.size), **macros)
