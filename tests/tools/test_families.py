"""Every family of problems runs on every kind of device, and a CPU taken for a GPU agrees with it.

With ``--record-kernels`` it shows ``tools/compile_gate.py`` most kernels with many macros.
"""

import pytest

import rift_cl as rift
from rift_cl.commands.devices.families import FAMILIES

# Their many kernels are compiled by the tests of the packages too.
_SLOW = ("fast", "splats", "Hermite splats", "cameras", "orders")
_OWN = ("adjoint", "footprints", "stack", "double", "solvers", "sorting", "lobes", "strips")
_FAMILIES = (*FAMILIES, *_OWN, "odd_sizes", "fast", "cameras", "orders")


def test_all_are_here(tool):
    assert set(tool("portability.problems").FAMILIES) == set(_FAMILIES)


@pytest.mark.parametrize("name", _FAMILIES)
def test_kinds_of_device_agree(tool, device, name, request):
    if name in _SLOW and not request.config.option.record_kernels:
        pytest.skip("compiled elsewhere; only for --record-kernels")
    differences, family = (
        tool("portability.differences"),
        tool("portability.problems").FAMILIES[name],
    )
    found = family(device, True)
    assert found or not device.traits.fp64
    wanted = family(rift.open_device(device.selector), True)
    assert differences.worst(wanted, found).relative <= differences.bound(name)
