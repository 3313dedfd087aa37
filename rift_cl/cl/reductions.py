"""Inner products of device arrays, the scalars that solvers steer by.

A kernel leaves a fixed number of partial sums, each with what rounding took from it; the host adds
those in float64. The order depends on the size and the device alone, so that equal arrays give
equal bits, and devices without float64 lose nothing to the length of the sum.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rift_cl.cl.host_arrays import download

if TYPE_CHECKING:
    from rift_cl.cl.array import DeviceArray
    from rift_cl.cl.device import Device

# Partial sums: enough to keep a device busy, few enough for the host. A CPU gets runs that are
# not shorter than this.
_CPU_SUMS, _GPU_SUMS = 256, 16384
_SHORTEST_RUN = 4096


def dot(device: Device, x: DeviceArray, y: DeviceArray) -> float:
    """The inner product of two device arrays of the same shape and type.

    A NaN or an infinity in either shows in the result.
    """
    return _reduce(device, x, y, product=True)


def total(device: Device, x: DeviceArray) -> float:
    """The sum of a device array's samples."""
    return _reduce(device, x, x, product=False)


def norm(device: Device, x: DeviceArray) -> float:
    """The Euclidean norm of a device array."""
    return math.sqrt(dot(device, x, x))


def _reduce(device: Device, x: DeviceArray, y: DeviceArray, *, product: bool) -> float:
    if x.size == 0:
        return 0.0
    cpu = device.traits.is_cpu
    length = -(-max(_SHORTEST_RUN, -(-x.size // _CPU_SUMS)) // 8) * 8
    count = -(-x.size // length) if cpu else min(x.size, _GPU_SUMS)
    sums = device.empty((2, count), x.dtype)
    device.launch(
        "dot_product",
        (count,),
        x=x,
        y=y,
        sums=sums,
        size=x.size,
        length=length,
        count=count,
        PRODUCT=int(product),
        DOUBLE=int(x.dtype == np.float64),
    )
    # Infinities of both signs make the NaN that they should, without a warning.
    with np.errstate(invalid="ignore"):
        return float(download(device, sums).sum(dtype=np.float64))
