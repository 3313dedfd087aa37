"""Arrays cross by DLPack on the host, and one that is elsewhere is named with the way out."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cl.host_arrays import as_real_array
from rift_cl.errors import DeviceError, DTypeError
from rift_cl.interop.dlpack import to_dlpack

pytestmark = pytest.mark.once


class Foreign:
    """What another package's array shows: DLPack alone, on a device of its own."""

    def __init__(self, values, kind=1):
        self.values, self.kind = values, kind

    def __dlpack__(self, **wanted):
        if self.kind != 1:
            raise BufferError("not on the host")
        return self.values.__dlpack__(**wanted)

    def __dlpack_device__(self):
        return self.kind, 0


def projector(device):
    return rift.Projector(rift.Grid((6, 7)), rift.Parallel([0.0, 1.0], 9), device=device)


def test_a_device_array_is_a_copy_for_numpy(device):
    A, x = projector(device), np.arange(42, dtype=np.float32).reshape(6, 7)
    y = A(device.array(x))
    copied = np.from_dlpack(to_dlpack(device, y))
    assert np.array_equal(copied, A(x))
    A(device.zeros((6, 7)), out=y)
    assert copied.any(), "the copy has memory of its own"


def test_a_device_array_is_a_copy_for_torch(device):
    torch = pytest.importorskip("torch", reason="torch is not installed")
    array = device.array(np.arange(6).reshape(2, 3))
    assert torch.from_dlpack(to_dlpack(device, array)).tolist() == [[0, 1, 2], [3, 4, 5]]


def test_an_array_that_has_dlpack_alone_is_taken_like_any_other(device):
    A, x = projector(device), np.arange(42, dtype=np.float32).reshape(6, 7)
    assert np.array_equal(A(Foreign(x)), A(x))
    assert np.array_equal(device.get(device.array(Foreign(x))), x)


@pytest.mark.parametrize(("kind", "name"), [(2, "CUDA"), (8, "Metal"), (14, "oneAPI")])
def test_an_array_elsewhere_is_named_with_the_way_to_the_host(device, kind, name):
    with pytest.raises(DeviceError, match=rf"x is a Foreign on a {name} device.*host") as caught:
        projector(device)(Foreign(np.zeros((6, 7)), kind))
    assert "\n" not in str(caught.value)


def test_an_array_that_refuses_for_another_reason_is_named_by_it():
    class Broken(Foreign):
        def __dlpack__(self, **wanted):
            raise BufferError("complex things\nand more")

    with pytest.raises(DTypeError, match=r"values .*: complex things$"):
        as_real_array(Broken(np.zeros(3)), name="values")


def test_what_is_no_device_array_is_named(device):
    with pytest.raises(DTypeError, match="array is a ndarray"):
        to_dlpack(device, np.zeros(3))
