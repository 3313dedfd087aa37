"""Inner products of arrays, the scalars that solvers steer by.

A kernel leaves a fixed number of partial sums, each with what rounding took from it; the host adds
those in float64. The order depends on the size and the device alone, so that equal arrays give
equal bits, and devices without float64 lose nothing to the length of the sum. Products of float32
that are too large or too small for it are summed once more, scaled by a power of two, so that
lengths in picometres and counts of photons serve as well as numbers near 1. Of arrays that stay
on the host some of these partial sums are made at a time, of the same samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.host_arrays import download, share
from rift_cl.cl.passing_parts import most_samples

if TYPE_CHECKING:
    from rift_cl.cl.array import AnyArray, DeviceArray
    from rift_cl.cl.device import Device

# Partial sums: enough to keep a device busy, few enough for the host. A CPU gets runs that are
# not shorter than this.
_CPU_SUMS, _GPU_SUMS = 256, 16384
_SHORTEST_RUN = 4096
# Below this, products have lost digits or all of them in float32; and by what power of two numbers
# are scaled down or up then, so that squares of all that matter fit.
_FAINTEST, _FAR = 1e-30, 80


def dot(device: Device, x: AnyArray, y: AnyArray) -> float:
    """The inner product of two arrays of the same shape and type, both on the device or the host.

    A NaN or an infinity in either shows in the result. Products beyond the range of float32 do no
    harm.
    """
    found = _reduce(device, x, y, product=True)
    if x.dtype != np.float32 or _FAINTEST < abs(found) < math.inf or not x.size:
        return found
    power = _FAR if abs(found) <= _FAINTEST else -_FAR
    again = math.ldexp(_reduce(device, x, y, product=True, scale=2.0**power), -2 * power)
    # What cancels may be faint as a sum alone, and is too large when it is scaled up.
    return again if math.isfinite(again) or power < 0 else found


def total(device: Device, x: AnyArray) -> float:
    """The sum of the samples of an array on the device or the host."""
    return _reduce(device, x, x, product=False)


def norm(device: Device, x: AnyArray) -> float:
    """The Euclidean norm of an array on the device or the host."""
    return math.sqrt(dot(device, x, x))


def _reduce(
    device: Device, x: AnyArray, y: AnyArray, *, product: bool, scale: float = 1.0
) -> float:
    if x.size == 0:
        return 0.0
    length = -(-max(_SHORTEST_RUN, -(-x.size // _CPU_SUMS)) // 8) * 8
    count = -(-x.size // length) if device.traits.is_cpu else min(x.size, _GPU_SUMS)
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        found = [
            _sums(device, share(device, a), share(device, b), length, stop - first, product, scale)
            for first, stop, a, b in _items(device, x, y, length, count)
        ]
        sums = np.concatenate(found, axis=1)
    else:
        assert not isinstance(x, np.ndarray) and not isinstance(y, np.ndarray)
        sums = _sums(device, x, y, length, count, product, scale)
    # Infinities of both signs make the NaN that they should, without a warning.
    with np.errstate(invalid="ignore"):
        return float(sums.sum(dtype=np.float64))


def _sums(
    device: Device,
    x: DeviceArray,
    y: DeviceArray,
    length: int,
    count: int,
    product: bool,
    scale: float,
) -> NDArray[Any]:
    """(2, count): what each work-item adds up, and what rounding took from it."""
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
        scale=scale,
        PRODUCT=int(product),
        DOUBLE=int(x.dtype == np.float64),
    )
    return download(device, sums)


def _items(
    device: Device, x: NDArray[Any], y: NDArray[Any], length: int, count: int
) -> Iterator[tuple[int, int, NDArray[Any], NDArray[Any]]]:
    """Runs of work-items, from first to stop, with the samples that are theirs.

    The samples of an item are a run of ``length`` on a CPU, and every ``count``-th on a GPU.
    """
    cpu, flat = device.traits.is_cpu, (x.reshape(-1), y.reshape(-1))
    each = length if cpu else -(-x.size // count)
    most = max(most_samples(device, x.itemsize) // each, 1)
    for first in range(0, count, most):
        stop = min(first + most, count)
        if cpu:
            a, b = (array[first * length : stop * length] for array in flat)
        else:
            a, b = (_columns(array, count, first, stop) for array in flat)
        yield first, stop, a, b


def _columns(array: NDArray[Any], count: int, first: int, stop: int) -> NDArray[Any]:
    """Columns of an array in rows of ``count``, of which the last may be shorter."""
    whole = array.size // count * count
    columns = array[:whole].reshape(-1, count)[:, first:stop].reshape(-1)
    return np.concatenate([columns, array[whole:][first:stop]])
