"""Whatever a caller calls an array: the right numbers reach the device, or a named error comes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from rift_cl.cl.host_arrays import as_host_array, check_output, download, share
from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError

REAL = ["f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "?"]
WRONG = ["c8", "c16", "M8[s]", "m8[s]", "S4", "U4", "O"]


def _gate(values, shape=None):
    shape = np.shape(values) if shape is None else shape
    return as_host_array(values, shape, name="sinogram", wants="Projector")


@st.composite
def laid_out(draw):
    """An array of any type, order, byte order, stride and alignment, and its plain twin."""
    order = draw(st.sampled_from("<>"))
    dtype = np.dtype(draw(st.sampled_from(REAL))).newbyteorder(order)
    shape = draw(arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5))
    elements = {"allow_nan": False, "allow_infinity": False} if dtype.kind == "f" else None
    array = draw(arrays.arrays(dtype, shape, elements=elements))
    layout = draw(st.sampled_from(["C", "F", "reversed", "strided", "transposed", "unaligned"]))
    if layout == "F":
        return np.asfortranarray(array)
    if layout == "reversed":
        return array[tuple(slice(None, None, -1) for _ in shape)]
    if layout == "strided":
        wide = np.zeros((*shape, 2), dtype)
        wide[..., 1] = array
        return wide[..., 1]
    if layout == "transposed":
        return np.ascontiguousarray(array).reshape(array.shape).T
    if layout == "unaligned":
        raw = np.zeros(array.nbytes + 1, np.uint8)
        shifted = raw[1:].view(dtype).reshape(shape)
        shifted[...] = array
        return shifted
    return array


@pytest.mark.full
@settings(max_examples=300, deadline=None)
@given(laid_out())
def test_any_layout_arrives_as_numpy_reads_it(array):
    with np.errstate(over="ignore"):
        wanted = array.astype(np.float32)
    if not np.isfinite(wanted).all():
        with pytest.raises(NonFiniteError):
            _gate(array)
        return
    plain = _gate(array)
    assert (plain.shape, plain.dtype) == (array.shape, np.dtype("=f4"))
    assert plain.flags.c_contiguous
    assert plain.flags.aligned
    assert plain.dtype.isnative
    np.testing.assert_array_equal(plain, wanted)


@settings(max_examples=30, deadline=None)
@given(array=laid_out())
def test_any_layout_survives_the_device(device, array):
    with np.errstate(over="ignore"):
        wanted = array.astype(np.float32) if array.dtype.kind in "fb" else array
    arrived = device.get(device.array(array))
    assert arrived.dtype == wanted.dtype.newbyteorder("=")
    np.testing.assert_array_equal(arrived, wanted)


@settings(max_examples=200, deadline=None)
@given(
    shape=arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3),
    wanted=arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3),
)
def test_another_shape_is_refused_and_both_are_named(shape, wanted):
    if shape == wanted:
        assert _gate(np.zeros(shape), wanted).shape == wanted
        return
    with pytest.raises(ShapeError) as caught:
        _gate(np.zeros(shape), wanted)
    assert all(text in str(caught.value) for text in (str(shape), str(wanted), "sinogram"))


def test_axes_in_another_order_are_told_with_what_puts_them_right():
    values = np.zeros((60, 20, 10))
    with pytest.raises(ShapeError, match="another order") as refused:
        _gate(values, (60, 10, 20))
    assert "numpy.transpose(sinogram, (0, 2, 1))" in str(refused.value)


@pytest.mark.parametrize("dtype", WRONG)
def test_what_is_no_real_number_is_refused(dtype, device):
    array = np.zeros((2, 2), dtype)
    with pytest.raises(DTypeError, match="sinogram has type"):
        _gate(array)
    with pytest.raises(DTypeError):
        device.array(array)


@pytest.mark.parametrize(
    "values",
    [
        None,
        "text",
        b"bytes",
        [[1.0, 2.0], [3.0]],
        [1.0, "two"],
        {"a": 1},
        {1.0, 2.0},
        object(),
        lambda x: x,
        np.zeros(2, [("a", "f4")]),
        [10**400],
        range,
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_no_array_is_refused(values, device):
    with pytest.raises(InputError):
        _gate(values, (2,))
    with pytest.raises(DTypeError):
        device.array(values)


def test_object_that_fails_to_become_an_array_is_refused():
    class Broken:
        def __array__(self, dtype=None, copy=None):
            raise RuntimeError("on another device")

    with pytest.raises(DTypeError, match="on another device"):
        _gate(Broken(), (2,))


def test_masked_array_is_refused_even_without_masked_values(device):
    for mask in (True, False):
        with pytest.raises(DTypeError, match="masked"):
            _gate(np.ma.array([1.0, 2.0], mask=[mask, False]))
        with pytest.raises(DTypeError, match="masked"):
            device.array(np.ma.array([1.0, 2.0], mask=[mask, False]))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", range(0, 15 * 17, 13))
def test_one_value_that_is_not_finite_is_found(bad, place):
    array = np.ones((15, 17), np.float32)
    array.flat[place] = bad
    with pytest.raises(NonFiniteError) as caught:
        _gate(array)
    assert f"in 1 places, first ({np.float32(bad)}) at {divmod(place, 17)}" in str(caught.value)


def test_bad_values_are_counted_and_found_beyond_the_first_block():
    array = np.zeros((3, 1 << 19), np.float32)
    array[2, -7:] = np.nan
    with pytest.raises(NonFiniteError) as caught:
        _gate(array)
    assert "in 7 places" in str(caught.value)
    assert str((2, (1 << 19) - 7)) in str(caught.value)


def test_value_too_large_for_float32_is_refused_whatever_the_error_state():
    for array in (np.array([1e39]), np.array([1, -1e300]), np.array([np.longdouble(1e300)])):
        with np.errstate(all="raise"), pytest.raises(NonFiniteError):
            _gate(array)
    with np.errstate(all="raise"):
        assert _gate(np.array([1e-300]))[0] == 0


def test_signalling_nan_is_refused_without_a_warning():
    array = np.array([0x7FF0000000000001], np.uint64).view(np.float64)
    with pytest.raises(NonFiniteError):
        _gate(array)


def test_plain_array_is_taken_without_a_copy():
    array = np.ones((3, 4), np.float32)
    assert _gate(array) is array
    array.flags.writeable = False
    assert _gate(array) is array


def test_lists_and_scalars_are_read():
    assert _gate([[1, 2], [3, 4]]).tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert _gate(3).shape == ()


def test_sharing_reads_the_same_numbers(device):
    for host in (np.arange(6, dtype=np.float32).reshape(2, 3), np.zeros((0, 3), np.float32)):
        host.flags.writeable = False
        shared = share(device, host)
        np.testing.assert_array_equal(device.get(shared), host)


def test_download_into_a_given_array(device):
    target = np.zeros((2, 3), np.float32)
    assert download(device, device.array(np.ones((2, 3))), target) is target
    assert (target == 1).all()


def test_output_must_be_writable_native_float32_of_the_shape():
    good = np.zeros((2, 3), np.float32)
    assert check_output(good, (2, 3)) is good
    locked = good.copy()
    locked.flags.writeable = False
    for bad in (None, [[0.0]], np.zeros((2, 3)), good.astype(">f4"), locked):
        with pytest.raises(DTypeError):
            check_output(bad, (2, 3))
    for bad in (np.zeros((3, 2), np.float32), np.asfortranarray(good), good[:, ::2]):
        with pytest.raises(ShapeError):
            check_output(bad, (2, 3))
