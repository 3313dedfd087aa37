"""Machines that are set up badly: a named error, or work goes on with one warning."""

from __future__ import annotations

import os
import sys

import pytest

# A small program, with any error of ours printed as its kind.
WORK = """
import numpy as np, rift_cl as rift
try:
    device = rift.default_device()
    x, y = device.array(np.ones((4, 4))), device.empty((4, 4))
    planes = {"by_rows": x, "by_columns": x, "row_pitch": 4, "column_pitch": 4}
    device.launch("plane_merge", (4, 4, 1), **planes, image=y, slice0=0, ny=4, nx=4)
    print("sum", float(device.get(y).sum()))
except rift.RiftError as error:
    print(type(error).__name__, error)
"""
WORKS = "sum 32.0"

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="ICD files and PoCL are Linux's")


@pytest.fixture
def pocl_only(monkeypatch):
    monkeypatch.setenv("RIFT_DEVICE", "pocl")


def _no_device(done):
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("NoDeviceError no OpenCL device was found")
    assert "pip install 'pyopencl[pocl]'" in done.stdout
    assert done.stderr == ""


def test_no_icd(python, tmp_path):
    # A path that ends in .icd stands for all of them, those that come with pyopencl as well.
    _no_device(python(WORK, OCL_ICD_VENDORS=str(tmp_path / "none.icd")))


def test_icd_that_points_nowhere(python, tmp_path):
    icd = tmp_path / "bad.icd"
    icd.write_text("/no/such/libOpenCL_driver.so\n")
    _no_device(python(WORK, OCL_ICD_VENDORS=str(icd)))


def test_icd_that_is_no_library(python, tmp_path):
    (tmp_path / "driver.so").write_bytes(b"not a library" * 100)
    icd = tmp_path / "bad.icd"
    icd.write_text(f"{tmp_path / 'driver.so'}\n")
    _no_device(python(WORK, OCL_ICD_VENDORS=str(icd)))


def test_bad_icd_does_not_hide_a_good_one(python, tmp_path, pocl_only):
    (tmp_path / "bad.icd").write_text("/no/such/libOpenCL_driver.so\n")
    done = python(WORK, OCL_ICD_VENDORS=str(tmp_path))
    assert done.stdout.strip() == WORKS, done.stderr


def test_no_device_lists_as_empty(python, tmp_path):
    done = python(
        "import rift_cl as rift; print(rift.devices())",
        OCL_ICD_VENDORS=str(tmp_path / "none.icd"),
    )
    assert (done.stdout.strip(), done.stderr) == ("()", "")


def _one_warning(done):
    assert (done.returncode, done.stdout.strip()) == (0, WORKS), done.stderr
    assert done.stderr.count("UserWarning") == 1
    assert "set RIFT_CACHE_DIR to a folder that you own" in done.stderr


@pytest.mark.full
@pytest.mark.parametrize("variable", ["HOME", "XDG_CACHE_HOME", "RIFT_CACHE_DIR"])
def test_cache_that_cannot_be_made(python, tmp_path, pocl_only, variable):
    (tmp_path / "file").write_text("")
    # Below a regular file and below /proc, where not even root can make a folder.
    impossible = "/proc/none" if variable == "RIFT_CACHE_DIR" else str(tmp_path / "file" / "none")
    changes = {"RIFT_CACHE_DIR": None, "XDG_CACHE_HOME": None, "TMPDIR": str(tmp_path)}
    _one_warning(python(WORK, **{**changes, variable: impossible}))


def test_drivers_own_cache_variable_does_no_harm(python, tmp_path, pocl_only):
    done = python(WORK, POCL_CACHE_DIR="/proc/none")
    assert (done.stdout.strip(), done.stderr) == (WORKS, "")


@pytest.mark.full
def test_home_that_is_not_set(python, tmp_path, pocl_only):
    done = python(WORK, HOME=None, RIFT_CACHE_DIR=None, XDG_CACHE_HOME=str(tmp_path))
    assert (done.stdout.strip(), done.stderr) == (WORKS, "")


def test_no_folder_at_all(python):
    # Python finds no temporary folder when every candidate is refused.
    code = (
        "import tempfile\n"
        "def refuse(*a, **k): raise FileNotFoundError('no usable temporary directory')\n"
        "tempfile.mkdtemp = refuse\n"
    )
    done = python(code + WORK, RIFT_CACHE_DIR="/proc/none")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("DeviceError compiled kernels can be kept neither in /proc/none")


@pytest.mark.full
@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root gives away")
@pytest.mark.parametrize("given", ["", "rift_cl", "rift_cl/{version}"])
def test_cache_of_another_user_is_refused(python, tmp_path, pocl_only, given):
    from rift_cl import __version__

    root = tmp_path / "cache"
    (root / "rift_cl" / __version__).mkdir(parents=True)
    os.chown(root / given.format(version=__version__), 1234, 1234)
    _one_warning(python(WORK, RIFT_CACHE_DIR=str(root), TMPDIR=str(tmp_path)))
    assert not any((root / "rift_cl" / __version__).iterdir())


def test_children_share_the_fallback_and_its_lock(python, tmp_path, pocl_only):
    code = (
        "import subprocess, sys, os, warnings\n"
        "warnings.simplefilter('ignore')\n"
        "from rift_cl.cl.build.kernel_cache import cache_folder\n"
        "print(cache_folder(), os.environ['POCL_CACHE_DIR'], flush=True)\n"
        "if len(sys.argv) == 1:\n"
        "    subprocess.run([sys.executable, '-c', sys.orig_argv[2], 'child'], check=True)\n"
    )
    done = python(code, RIFT_CACHE_DIR="/proc/none", TMPDIR=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.split()) == 4
    assert len(set(done.stdout.split())) == 1
    assert done.stderr == ""


@pytest.mark.full
def test_relative_cache_survives_a_change_of_folder(python, tmp_path, pocl_only):
    code = f"import os; os.chdir({str(tmp_path)!r})\n"
    later = "import rift_cl as rift; rift.devices(); os.mkdir('below'); os.chdir('below')\n"
    done = python(code + later + WORK, RIFT_CACHE_DIR="kernels")
    assert (done.stdout.strip(), done.stderr) == (WORKS, "")
    assert not (tmp_path / "below" / "kernels").exists()
