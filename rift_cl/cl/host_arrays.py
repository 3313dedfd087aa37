"""The gate between host arrays and a device.

Drivers copy bytes: a Fortran-ordered array arrives transposed, a big-endian one as noise, a
shorter one without a word. So every host array passes through ``as_host_array`` first, which
gives back C-ordered native float32 (float64 where wanted) of the wanted shape, or one clear error.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.failures import named_errors
from rift_cl.errors import DeviceError, DTypeError, InputError, NonFiniteError, ShapeError

if TYPE_CHECKING:
    from rift_cl.cl.array import DeviceArray
    from rift_cl.cl.device import Device

_BLOCK = 1 << 20
# The axes of arrays here, in their order, by the names that they have where axes have names.
NAMED_AXES = (("z", "y", "x"), ("theta", "row", "detector"))
# Devices of the DLPack standard whose memory the host does not read, by their numbers.
_ELSEWHERE = {
    2: "CUDA",
    4: "OpenCL",
    7: "Vulkan",
    8: "Metal",
    10: "ROCm",
    14: "oneAPI",
    15: "WebGPU",
}


def as_host_array(
    values: Any,
    shape: tuple[int, ...],
    *,
    name: str,
    wants: str,
    dtype: DTypeLike = np.float32,
) -> NDArray[Any]:
    """Bring an array into the one form that may cross to a device.

    Args:
        values: anything NumPy reads as an array of real numbers, of any order and byte order.
        shape: the shape it must have.
        name: what the caller calls it, for the error.
        wants: who wants this shape, for the error.
        dtype: the type to bring it to.

    Returns:
        The same values, C-ordered, in native ``dtype``; ``values`` itself where it already is that.

    Raises:
        ShapeError: the shape differs.
        DTypeError: the values are not real numbers.
        NonFiniteError: a value is NaN or infinite, or too large for ``dtype``.
    """
    array = as_real_array(values, name=name)
    if array.shape != shape:
        remedy = _other_order(name, array.shape, shape)
        raise ShapeError(f"{name} has shape {array.shape}, {wants} wants {shape}{remedy}")
    plain = as_plain(array, dtype)
    check_finite(plain, name=name)
    return plain


def _other_order(name: str, given: tuple[int, ...], wanted: tuple[int, ...]) -> str:
    """How the error ends where the same axes come in another order, as rows for bins do."""
    if sorted(given) != sorted(wanted):
        return ""
    orders = itertools.permutations(range(len(given)))
    order = next(axes for axes in orders if tuple(given[axis] for axis in axes) == wanted)
    return f": are its axes in another order? numpy.transpose({name}, {order}) has this shape"


def as_real_array(values: Any, *, name: str) -> NDArray[Any]:
    """Read anything as a NumPy array of real numbers.

    Arrays of other packages are read by ``__array__`` or, where they have none, by DLPack.

    Raises:
        DTypeError: the values are not real numbers, or a tensor that keeps gradients.
        ShapeError: their axes have names, those of ``NAMED_AXES``, and are in another order.
        DeviceError: they are on a device whose memory the host does not read.
    """
    if isinstance(values, np.ma.MaskedArray):
        raise DTypeError(f"{name} is a masked array: fill the masked values first")
    if is_tensor(values) and getattr(values, "requires_grad", False):
        raise DTypeError(
            f"{name} is a tensor with requires_grad, and no gradients pass through what it is "
            f"given to: give {name}.detach()"
        )
    _check_order(values, name=name)
    try:
        array = np.from_dlpack(values) if _dlpack_alone(values) else np.asarray(values)
    except (TypeError, ValueError, RuntimeError, BufferError) as error:
        check_reachable(values, name=name)
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise DTypeError(f"{name} cannot be read as an array of numbers: {reason}") from error
    if array.dtype.kind not in "fiub":
        raise DTypeError(f"{name} has type {array.dtype}, wanted real numbers (float32)")
    return array


def _check_order(values: Any, *, name: str) -> None:
    """Refuse an xarray.DataArray with the axes of an image or a scan in another order than ours."""
    if not (hasattr(values, "dims") and hasattr(values, "coords")):
        return
    given = tuple(values.dims)
    for axes in NAMED_AXES:
        wanted = tuple(axis for axis in axes if axis in given)
        if set(wanted) == set(given) and wanted != given:
            raise ShapeError(
                f"{name} has the dimensions {', '.join(given)}, wanted {', '.join(wanted)}: "
                f"give {name}.transpose{wanted}"
            )


def _dlpack_alone(values: Any) -> bool:
    kind = type(values)
    return hasattr(kind, "__dlpack__") and not hasattr(kind, "__array__")


def check_reachable(values: Any, *, name: str) -> None:
    """Refuse an array on a device of which the host cannot read, as DLPack tells it.

    Raises:
        DeviceError: it is on such a device; the sentence says how to copy it to the host.
    """
    if not hasattr(type(values), "__dlpack_device__"):
        return
    kind = _ELSEWHERE.get(int(values.__dlpack_device__()[0]))
    if kind is not None:
        raise DeviceError(
            f"{name} is a {type(values).__name__} on a {kind} device, whose memory is not read "
            "here: copy it to the host first, by x.cpu() (torch), cupy.asnumpy(x) or "
            "jax.device_get(x)"
        )


def as_plain(array: NDArray[Any], dtype: DTypeLike) -> NDArray[Any]:
    """The same values in the one form that a driver takes: aligned, C-ordered, of this type."""
    # A value too large for float32 becomes infinite, whatever numpy.seterr says.
    with np.errstate(all="ignore"):
        return np.require(array, dtype, ["C_CONTIGUOUS", "ALIGNED"])


def check_finite(array: NDArray[Any], *, name: str) -> None:
    """Raise if any value is NaN or infinite: one of them spoils a whole filtered slice.

    Raises:
        NonFiniteError: with the first such position and the number of them.
    """
    flat = array.reshape(-1)
    for start in range(0, flat.size, _BLOCK):
        if not np.isfinite(flat[start : start + _BLOCK]).all():
            bad = np.flatnonzero(~np.isfinite(flat))
            place = tuple(int(i) for i in np.unravel_index(bad[0], array.shape))
            raise NonFiniteError(
                f"{name} holds NaN or infinity in {bad.size} places, first ({flat[bad[0]]}) at "
                f"{place}: replace them before, for example with numpy.nan_to_num"
            )


def upload(device: Device, host: NDArray[Any]) -> DeviceArray:
    """Copy a C-ordered host array into a new device array."""
    import pyopencl as cl

    array = device.empty(host.shape, host.dtype)
    if host.size:
        with named_errors(f"copying {host.nbytes} bytes to it", device.name):
            cl.enqueue_copy(device.queue, array.base_data, host, is_blocking=True)
    return array


def send(device: Device, host: NDArray[Any]) -> DeviceArray:
    """Copy a C-ordered host array into a buffer of its own, past the queue.

    A copy through the queue would wait for all that was enqueued before. The buffer comes from the
    driver and not from the pool, so this is for the few arrays of a step and not for volumes.
    """
    import pyopencl as cl
    from pyopencl.array import Array

    if host.size == 0:
        return upload(device, host)
    device.check_array(host.nbytes, host.shape)
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
    with named_errors(f"copying {host.nbytes} bytes to it", device.name):
        buffer = cl.Buffer(device.context, flags, hostbuf=host)
        array: DeviceArray = Array(device.queue, host.shape, host.dtype, data=buffer)
        return array


def share(device: Device, host: NDArray[Any]) -> DeviceArray:
    """Give a device a C-ordered host array to read: without a copy where memory is shared.

    The host array must outlive every kernel that reads the result.
    """
    import pyopencl as cl
    from pyopencl.array import Array

    if not device.traits.unified or host.size == 0:
        return upload(device, host)
    device.check_array(host.nbytes, host.shape)
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR
    with named_errors(f"sharing {host.nbytes} bytes with it", device.name):
        buffer = cl.Buffer(device.context, flags, hostbuf=host)
        array: DeviceArray = Array(device.queue, host.shape, host.dtype, data=buffer)
        return array


def download(device: Device, array: DeviceArray, out: NDArray[Any] | None = None) -> NDArray[Any]:
    """Copy a device array to the host, after everything enqueued before.

    Args:
        device: where the array lives.
        array: the device array.
        out: C-ordered host array of the same shape and type to fill; a new one if not given.

    Raises:
        ShapeError: the array is a strided view.
        DeviceError: the array belongs to another device.
    """
    import pyopencl as cl

    _check_whole(device, array, name="array")
    host = np.empty(array.shape, array.dtype) if out is None else out
    if host.size:
        with named_errors(f"copying {host.nbytes} bytes from it", device.name):
            cl.enqueue_copy(device.queue, host, array.base_data, is_blocking=True)
    return host


def fetch(device: Device, array: DeviceArray, count: int) -> Callable[[], NDArray[Any]]:
    """Start to copy the first numbers of a device array to the host.

    Returns:
        A function that waits for them and returns them, (count,), while the device goes on with
        what was enqueued after this call.
    """
    import pyopencl as cl

    host = np.empty(count, array.dtype)
    doing = f"copying {host.nbytes} bytes from it"
    with named_errors(doing, device.name):
        event = cl.enqueue_copy(device.queue, host, array.base_data, is_blocking=False)
        device.queue.flush()

    def wait() -> NDArray[Any]:
        with named_errors(doing, device.name):
            event.wait()
        return host

    return wait


def as_device_array(
    device: Device,
    array: Any,
    shape: tuple[int, ...],
    *,
    name: str,
    dtype: DTypeLike = np.float32,
    inside: bool = False,
) -> DeviceArray:
    """Check a device array that a caller handed in, and wait for it where it is another queue's.

    What another queue is to do with it afterwards has to wait too: ``finish_for_others``.

    Args:
        device: that it has to be on.
        array: what came.
        shape: that it has to have.
        name: what the caller calls it, for the error.
        dtype: that it has to have.
        inside: whether it may begin inside the buffer of another array, as ``stack[1]`` does.

    Raises:
        ShapeError: the shape or memory order is not the wanted one.
        DTypeError: the values are not of type ``dtype``.
        DeviceError: the array belongs to another device.
    """
    if not is_device_array(array):
        raise DTypeError(
            f"{name} is a {type(array).__name__} on the host, wanted a device array like the other"
        )
    if array.shape != shape:
        raise ShapeError(f"{name} has shape {array.shape}, wanted {shape}")
    if array.dtype != dtype:
        wanted = np.dtype(dtype).name
        raise DTypeError(f"{name} has type {array.dtype} on the device, wanted {wanted}")
    _check_whole(device, array, name=name, inside=inside)
    return array


def _check_whole(device: Device, array: DeviceArray, *, name: str, inside: bool = False) -> None:
    """Kernels and copies see buffers, and know nothing of views into them or of other queues."""
    # A copy of an output would be written in its place.
    own = "give an array of its own"
    if not array.flags.c_contiguous:
        # pyopencl copies no such view.
        remedy = own if name == "out" else "upload that part of the host's array by itself"
        raise ShapeError(f"{name} is a strided view on the device: {remedy}")
    remedy = own if name == "out" else f"pass {name}.copy()"
    if array.offset and not inside:
        raise ShapeError(f"{name} is a view that begins inside another device array: {remedy}")
    if array.context != device.context:
        raise DeviceError(f"{name} lives on another device than {device.name}: copy it over first")
    _wait_for_others(device, array)


def _wait_for_others(device: Device, array: DeviceArray) -> None:
    """Wait for what another queue than the device's own still does to an array.

    An event of the array tells of pyopencl's arithmetic alone: its queue knows the rest.
    """
    own = device.queue
    if array.queue is own and not array.events:
        return
    with named_errors("finishing the work of another queue", device.name):
        if array.queue is not None and array.queue != own:
            array.queue.finish()
        # With its queue taken away or replaced (``with_queue``) it keeps its events.
        for event in array.events:
            if event.command_queue != own:
                event.wait()


def finish_for_others(device: Device, *arrays: DeviceArray | None) -> None:
    """Wait for all work if one of these arrays is another queue's, which knows nothing of it.

    It may then read what was written to the array, and write what was read from it. Arrays of the
    device's own queue cost nothing.
    """
    own = device.queue
    if any(array is not None and array.queue != own for array in arrays):
        device.finish()


def is_device_array(value: object) -> TypeGuard[DeviceArray]:
    """Whether a value is a ``pyopencl.array.Array`` (asked without importing pyopencl)."""
    return hasattr(value, "base_data") and hasattr(value, "queue")


def is_tensor(value: Any) -> bool:
    """Whether a value is a ``torch.Tensor`` (asked without importing torch)."""
    return hasattr(type(value), "__torch_function__")


def is_jax_array(value: Any) -> bool:
    """Whether a value is an array of JAX's or stands for one (asked without importing JAX)."""
    return type(value).__module__.partition(".")[0] in ("jax", "jaxlib")


def alike(found: NDArray[Any], given: Any) -> Any:
    """An array as a tensor of torch or an array of JAX, where what was given is one.

    Gradients do not pass: it is for results of what has none, as those of solvers that iterate.
    """
    if is_tensor(given):
        return sys.modules["torch"].from_numpy(found)
    if is_jax_array(given):
        return sys.modules["jax"].numpy.asarray(found)
    return found


def check_output(out: Any, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> NDArray[Any]:
    """Check a host array that a result is to be written into.

    Raises:
        ShapeError: its shape or memory order is not the wanted one.
        DTypeError: it is no writable array of type ``dtype``.
    """
    wanted = np.dtype(dtype)
    if not isinstance(out, np.ndarray) or out.dtype != wanted or not out.flags.writeable:
        raise DTypeError(f"out must be a writable NumPy array of native {wanted.name}")
    if out.shape != shape:
        raise ShapeError(f"out has shape {out.shape}, wanted {shape}")
    if not out.flags.c_contiguous:
        raise ShapeError("out is not in C order: give a contiguous array (numpy.empty makes one)")
    return out


def check_apart(x: Any, out: Any, *, name: str) -> None:
    """Refuse an output that shares memory with the input: parts would be read too late.

    Raises:
        InputError: the two share memory.
    """
    if is_device_array(x):
        shared = x.base_data is not None and x.base_data == out.base_data
        shared = shared and x.offset < out.offset + out.nbytes and out.offset < x.offset + x.nbytes
    else:
        shared = np.may_share_memory(x, out)
    if shared:
        raise InputError(f"out shares memory with {name}: give it memory of its own")
