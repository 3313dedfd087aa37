"""Importing the package is light, touches no driver, and its public names are all there."""

from __future__ import annotations

from importlib import import_module

import pytest

import rift_cl as rift

HEAVY = ("pyopencl", "torch", "kornia", "matplotlib", "scipy", "skimage", "h5py", "zarr", "rich")


def test_import_loads_nothing_heavy(python):
    done = python(f"import sys, rift_cl; print([m for m in {HEAVY!r} if m in sys.modules])")
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "[]", "")


def test_import_and_geometry_touch_no_driver(python):
    done = python(
        "import sys, rift_cl as rift\n"
        "from rift_cl.cl import process\n"
        "rift.Grid((4, 4)), rift.Parallel([0.0], 4)\n"
        "print(process._owner, 'pyopencl' in sys.modules)"
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "None False", "")


def test_device_layer_imports_without_pyopencl(python):
    done = python(
        "import sys, rift_cl.cl, rift_cl.operators, rift_cl.reconstruct\n"
        "print('pyopencl' in sys.modules)"
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "False", "")


@pytest.mark.parametrize("name", rift.__all__)
def test_public_name_resolves(name):
    assert getattr(rift, name) is getattr(rift, name)
    assert name in dir(rift)


@pytest.mark.parametrize("package", ["rift_cl", "rift_cl.io", "rift_cl.splat", "rift_cl.train"])
def test_names_that_a_package_looks_up_are_those_that_it_lists(package):
    module = import_module(package)
    assert set(dir(module)) == set(module.__all__)
    assert all(getattr(module, name) is not None for name in module.__all__)
    with pytest.raises(AttributeError, match="no_such_name"):
        module.no_such_name  # noqa: B018 - looking it up is the test


def test_public_names_are_unique_and_star_import_works(python):
    assert len(set(rift.__all__)) == len(rift.__all__)
    done = python("from rift_cl import *; print(Grid.__name__, RiftError.__name__)")
    assert (done.returncode, done.stdout.strip()) == (0, "Grid RiftError")


def test_every_error_is_a_rift_error_with_an_exit_status():
    from rift_cl import errors

    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type)]
    assert len(kinds) >= 15
    assert all(issubclass(kind, rift.RiftError) for kind in kinds)
    assert {kind.exit_status for kind in kinds} == {1, 3, 4, 5, 130}
    assert issubclass(errors.ShapeError, ValueError)
    assert issubclass(errors.DeviceMemoryError, MemoryError)
    assert issubclass(errors.OutputError, OSError)
