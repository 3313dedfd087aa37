"""Device arrays for whoever reads DLPack: NumPy, torch, JAX, CuPy.

    from rift_cl.interop.dlpack import to_dlpack

    tensor = torch.from_dlpack(to_dlpack(device, array))

No other package reads the memory of an OpenCL device, so that what crosses is a copy on the host,
made when it is asked for. The other way needs nothing: operators, ``device.array`` and all that
takes an array take whatever has ``__dlpack__`` or ``__array__`` on the host.
"""

from __future__ import annotations

from typing import Any

from rift_cl.cl.array import AnyArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import is_device_array
from rift_cl.errors import DTypeError

__all__ = ["HostCopy", "to_dlpack"]

# DLPack's number of the host.
_CPU = (1, 0)


class HostCopy:
    """A device array that DLPack sees on the host.

    Args:
        device: where the array is.
        array: of any shape and type.
    """

    def __init__(self, device: Device, array: AnyArray) -> None:
        self._device, self._array = device, array

    def __dlpack__(self, **wanted: Any) -> Any:
        """The capsule of a new copy, made after everything that was enqueued before."""
        return self._device.get(self._array).__dlpack__(**wanted)

    def __dlpack_device__(self) -> tuple[int, int]:
        """The host."""
        return _CPU


def to_dlpack(device: Device, array: AnyArray) -> HostCopy:
    """A device array for ``numpy.from_dlpack`` and its like.

    Args:
        device: where the array is.
        array: what an operator or a renderer gave on that device.

    Raises:
        DTypeError: it is no device array.
    """
    if not is_device_array(array):
        raise DTypeError(
            f"array is a {type(array).__name__}, wanted a device array, such as device.array(x)"
        )
    return HostCopy(device, array)
