"""A launch refuses buffers that are shorter than its kernel goes through, which each kernel says.

Nothing runs here: what the sources declare is compared with arrays that have a length and no
memory, for every variant of every kernel that is known (``tools/portability/variants.py``).
"""

from __future__ import annotations

import re
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl.cl.bounds import declared
from rift_cl.cl.build import source
from rift_cl.cl.signature import Arguments, signature
from rift_cl.errors import KernelArgumentError

# What kernels are given for their numbers, where it is not 4; and the work-items of a launch.
_NUMBERS = {"above": 0, "shift": 0, "width": 12, "stride": 8}
_ITEMS = (8, 4, 3)
# Macros that no recorded variant has, and without which a buffer is not gone through.
_MORE = {
    "fft_unpack": ("MASKED=1",),
    "loss_grad": ("WEIGHTED=1",),
    "residual_image": ("WEIGHTED=1",),
    "splat_activate": ("BAND=1",),
    "splat_project_grad": ("ABSGRAD=1", "DEFOCUS=1"),
    "ssim_map": ("WEIGHTED=1",),
}
every_kernel = pytest.mark.parametrize("name", source.kernel_names())


@pytest.fixture
def signatures(tool):
    """What the variants of a kernel take."""
    return partial(_signatures, tool("portability.variants"))


@cache
def _signatures(known, name):
    more = [known.Variant(name, "cpu", _MORE[name])] if name in _MORE else []
    found = []
    for variant in [*known.variants((name,)), *more]:
        given = (define.removeprefix("-D").split("=", 1) for define in variant.defines)
        found.append(signature(name, source.kernel_source(name), dict(given)))
    return found


def _array(parameter, size=1):
    return SimpleNamespace(
        offset=0, dtype=parameter.dtype, size=size, shape=(size,), base_data=None
    )


def _is_array(given):
    return isinstance(given, SimpleNamespace)


def _given(kernel):
    """What a launch may give a kernel, with arrays that are as long as they must be."""
    given = {}
    for each in kernel.parameters:
        number = _NUMBERS.get(each.name, 4)
        given[each.name] = number if each.lanes == 1 else _array(each)
        if each.lanes > 1:
            given[each.name] = np.zeros(each.lanes, each.dtype)
    numbers = [*given.values(), *_ITEMS]
    for bound in kernel.bounds:
        given[kernel.parameters[bound.buffer].name].size = bound.least(numbers)
    return given


@every_kernel
def test_every_buffer_of_every_kernel_has_a_declared_shape(name, signatures):
    text = source.kernel_source(name)
    shapes = declared(text)
    for kernel in signatures(name):
        taken = [each.name for each in kernel.parameters if each.lanes == 0]
        assert set(taken) <= set(shapes)
    for buffer in shapes:
        assert re.search(rf"__global\s[^;{{}}]*\b{buffer}\b", text)


@every_kernel
def test_a_buffer_that_is_one_number_short_is_refused_by_name(name, signatures):
    refused, tried = set(), set()
    for kernel in signatures(name):
        given = _given(kernel)
        lengths = tuple((name, array.size) for name, array in given.items() if _is_array(array))
        if lengths in tried:
            continue
        tried.add(lengths)
        arguments = Arguments(kernel, given)
        arguments.in_order(given, _ITEMS)
        for bound in kernel.bounds:
            parameter = kernel.parameters[bound.buffer]
            size = given[parameter.name].size
            if size > 0:
                refused.add(parameter.name)
                short = {**given, parameter.name: _array(parameter, size - 1)}
                with pytest.raises(KernelArgumentError, match=rf"{name}.*\b{parameter.name}\b"):
                    arguments.in_order(short, _ITEMS)
                assert Arguments(kernel, given).in_order(given, _ITEMS)
    shapes = declared(source.kernel_source(name))
    taken = {each.name for kernel in signatures(name) for each in kernel.parameters}
    assert refused == {buffer for buffer in taken & set(shapes) if shapes[buffer] != "*"}
