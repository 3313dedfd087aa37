"""Launches name what a kernel takes, and are refused where it takes something else."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.cl.build import source
from rift_cl.cl.build.builder import OPTIONS
from rift_cl.cl.signature import signature
from rift_cl.errors import KernelArgumentError

_NAMES = {
    np.dtype(np.float32): "float",
    np.dtype(np.float64): "double",
    np.dtype(np.int32): "int",
    np.dtype(np.int64): "long",
    np.dtype(np.uint32): "uint",
    np.dtype(np.uint64): "ulong",
    np.dtype(np.uint8): "uchar",
}
# Variants whose parameter lists or types differ from those of a kernel's own defaults.
_VARIANTS = [
    *((name, {}) for name in source.kernel_names()),
    ("splat_project", {"COVARIANCES": 1, "DEFOCUS": 1}),
    ("splat_project", {"MODAL": 1, "SHAPE_ORDER": 1}),
    ("splat_project_grad", {"COVARIANCES": 1, "DEFOCUS": 1}),
    ("splat_project_grad", {"VIEW_PARTS": 1}),
    ("hermite_project", {"MODAL": 1, "DEFOCUS": 1}),
    ("scan_sum_cpu", {"WIDE": 1}),
    ("scan_sum_gpu", {"WIDE": 1}),
    ("tile_count", {"WHOLE": 1}),
    ("tile_count", {"ELLIPSES": 1}),
    ("scan_place_cpu", {"WIDE": 1}),
    ("scan_place_gpu", {"WIDE": 1}),
]


@pytest.mark.parametrize(("name", "macros"), _VARIANTS, ids=str)
def test_the_compiler_reads_the_same_signature(device, name, macros):
    """The driver's own list of arguments is the oracle."""
    import pyopencl as cl

    kind = "cpu" if device.traits.is_cpu else "gpu"
    if name.endswith(("_cpu", "_gpu")) and not name.endswith(kind):
        pytest.skip("a driver for the other kind of device")
    text = source.kernel_source(name)
    defines = device._programs._builder.defines(tuple((key, str(macros[key])) for key in macros))
    options = [*OPTIONS, "-cl-kernel-arg-info", *(f"-D{key}={defines[key]}" for key in defines)]
    kernel = cl.Kernel(cl.Program(device.context, text).build(options), name)
    ours = signature(name, text, defines).parameters
    assert len(ours) == kernel.num_args
    info = cl.kernel_arg_info
    for number, parameter in enumerate(ours):
        # PoCL renames what OpenCL has a function of that name for.
        assert kernel.get_arg_info(number, info.NAME).removeprefix("_cl_") == parameter.name
        address = kernel.get_arg_info(number, info.ADDRESS_QUALIFIER)
        is_buffer = address == cl.kernel_arg_address_qualifier.GLOBAL
        assert is_buffer == (parameter.lanes == 0)
        kept = kernel.get_arg_info(number, info.TYPE_NAME).rstrip("*")
        if kept.rstrip("0123456789") not in ("real", "number"):
            lanes = "" if parameter.lanes < 2 else str(parameter.lanes)
            assert kept.rstrip("0123456789") == _NAMES[parameter.dtype]
            assert is_buffer or kept == _NAMES[parameter.dtype] + lanes


def test_types_that_a_macro_chooses():
    text = source.kernel_source("axpby")
    for double, wanted in (("0", np.float32), ("1", np.float64)):
        found = signature("axpby", text, {"DOUBLE": double}).parameters
        types = {each.dtype for each in found[:4]}
        assert types == {np.dtype(wanted)}


@pytest.fixture
def given(device):
    """A launch of ``axpby`` that is right."""
    x, y = device.array(np.ones(4)), device.array(np.ones(4))
    return {"x": x, "y": y, "a": 2, "b": 3.0, "size": np.int64(4), "RUN": 4}


def test_a_launch_by_name_in_any_order(device, given):
    device.launch("axpby", (1,), **dict(reversed(given.items())))
    assert device.get(given["y"]).tolist() == [5, 5, 5, 5]


@pytest.mark.parametrize("name", ["x", "a", "size"])
def test_a_missing_argument_is_named(device, given, name):
    del given[name]
    with pytest.raises(KernelArgumentError, match=rf"axpby.*\b{name}"):
        device.launch("axpby", (1,), **given)


def test_an_unknown_argument_is_named_and_none_is_no_argument(device, given):
    device.launch("axpby", (1,), **given, other=None)
    with pytest.raises(KernelArgumentError, match=r"axpby.*other"):
        device.launch("axpby", (1,), **given, other=1)
    with pytest.raises(KernelArgumentError, match=r"axpby.*z is unknown"):
        device.launch("axpby", (1,), z=given.pop("x"), **given)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("a", "2"),
        ("a", None),
        ("size", 4.0),
        ("size", -1),
        ("size", 1 << 64),
        ("x", 1.0),
        ("x", np.ones(4, np.float32)),
    ],
)
def test_a_wrongly_typed_argument_is_named(device, given, name, value):
    with pytest.raises(KernelArgumentError, match=rf"axpby.*\bargument {name}\b"):
        device.launch("axpby", (1,), **{**given, name: value})


@pytest.mark.parametrize("size", [[1], 1, (), (1.0,), (-1,), (1, 1, 1, 1), "1", None])
def test_a_size_that_is_no_grid_is_named(device, given, size):
    device.launch("axpby", (np.int64(1),), **given)
    with pytest.raises(KernelArgumentError, match=r"axpby: work-items are .*tuple"):
        device.launch("axpby", size, **given)


def test_arrays_of_another_type_and_views_are_refused(device, given):
    for wrong in (device.zeros(4, np.int32), device.zeros(8)[4:]):
        with pytest.raises(KernelArgumentError, match=r"\bargument x\b"):
            device.launch("axpby", (1,), **{**given, "x": wrong})


def test_a_vector_by_value_has_its_length_and_type(device):
    arrays = {name: device.zeros((1, 4)) for name in ("image", "exposed")}
    plain = np.ones(4, np.float32)
    device.launch("expose", (1,), **arrays, gain=plain, offset=plain, pixels=1)
    for wrong in (np.ones(4), np.ones(3, np.float32), 1.0):
        with pytest.raises(KernelArgumentError, match=r"\bargument offset\b"):
            device.launch("expose", (1,), **arrays, gain=plain, offset=wrong, pixels=1)


def test_a_constant_that_a_kernel_does_not_have_is_refused(device):
    array = device.zeros(4)
    given = {"x": array, "y": array, "a": 1.0, "b": 1.0, "size": 4}
    with pytest.raises(KernelArgumentError, match="kernel axpby: has no compile-time constant RUM"):
        device.launch("axpby", (4,), **given, RUM=1)
    assert not device.get(array).any()
