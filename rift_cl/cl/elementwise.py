"""What solvers do to whole arrays besides adding them: copy, weigh, clip, pull.

Sums and multiples are in ``rift_cl.cl.arithmetic``, inner products in ``rift_cl.cl.reductions``.
Arrays may be on the host as well, all of them there; levels are on the device.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rift_cl.cl.failures import named_errors
from rift_cl.cl.passing_parts import CPU_RUN, pass_parts

if TYPE_CHECKING:
    from rift_cl.cl.array import AnyArray, DeviceArray
    from rift_cl.cl.device import Device


def copy(device: Device, x: AnyArray, y: AnyArray) -> None:
    """Y = x, whatever y held before."""
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        np.copyto(y, x)
        return
    assert not isinstance(x, np.ndarray) and not isinstance(y, np.ndarray)
    _copy_bytes(device, x, 0, y, 0, x.nbytes)


def take(device: Device, x: DeviceArray, index: int, y: DeviceArray) -> None:
    """Y = x[index]."""
    take_run(device, x, index * y.size, y)


def put(device: Device, x: DeviceArray, y: DeviceArray, index: int) -> None:
    """Y[index] = x."""
    put_run(device, x, y, index * x.size)


def take_run(device: Device, x: DeviceArray, first: int, y: DeviceArray) -> None:
    """Y = the samples of x from ``first`` on, in C order."""
    _copy_bytes(device, x, first * x.dtype.itemsize, y, 0, y.nbytes)


def put_run(device: Device, x: DeviceArray, y: DeviceArray, first: int) -> None:
    """X becomes the samples of y from ``first`` on, in C order."""
    _copy_bytes(device, x, 0, y, first * y.dtype.itemsize, x.nbytes)


def with_own_buffer(device: Device, x: DeviceArray) -> DeviceArray:
    """An array itself, or its copy where it begins inside the buffer of another, as x[1] does."""
    if not x.offset:
        return x
    y = device.empty(x.shape, x.dtype)
    _copy_bytes(device, x, x.offset, y, 0, x.nbytes)
    return y


def put_inside(device: Device, x: DeviceArray, y: DeviceArray) -> DeviceArray:
    """Y = x, where y may begin inside the buffer of another array; y."""
    _copy_bytes(device, x, 0, y, y.offset, x.nbytes)
    return y


def _copy_bytes(
    device: Device, x: DeviceArray, x_first: int, y: DeviceArray, y_first: int, count: int
) -> None:
    import pyopencl as cl

    if count:
        with named_errors("copying an array", device.name):
            cl.enqueue_copy(
                device.queue,
                y.base_data,
                x.base_data,
                byte_count=count,
                src_offset=x_first,
                dst_offset=y_first,
            )


def multiply(device: Device, w: AnyArray, y: AnyArray) -> None:
    """Y = w y, sample by sample."""
    if isinstance(w, np.ndarray) and isinstance(y, np.ndarray):
        pass_parts(device, lambda w, y: multiply(device, w, y), w, y)
        return
    _launch(device, "multiply", y, w=w)


def clip_negative(device: Device, y: AnyArray) -> None:
    """Y = max(y, 0), sample by sample."""
    if isinstance(y, np.ndarray):
        pass_parts(device, lambda y: clip_negative(device, y), y)
        return
    _launch(device, "clip_negative", y)


def clip_between(device: Device, low: AnyArray, high: AnyArray, y: AnyArray) -> None:
    """Y = min(max(y, low), high), sample by sample."""
    if isinstance(low, np.ndarray) and isinstance(high, np.ndarray) and isinstance(y, np.ndarray):
        pass_parts(device, lambda a, b, y: clip_between(device, a, b, y), low, high, y)
        return
    _launch(device, "clip_between", y, low=low, high=high)


def pull_to_levels(
    device: Device, levels: DeviceArray, strength: float, x: AnyArray, y: AnyArray
) -> None:
    """Y += strength (m - x), m the middle of the two of the ascending levels about x."""
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        pass_parts(device, lambda x, y: pull_to_levels(device, levels, strength, x, y), x, y)
        return
    _launch(device, "level_pull", y, levels=levels, count=levels.size, strength=strength, x=x)


def _launch(device: Device, kernel: str, y: AnyArray, **given: AnyArray | float) -> None:
    run = CPU_RUN if device.traits.is_cpu else 1
    macros = {"RUN": run, "DOUBLE": int(y.dtype == np.float64)}
    device.launch(kernel, (-(-y.size // run),), y=y, size=y.size, **given, **macros)
