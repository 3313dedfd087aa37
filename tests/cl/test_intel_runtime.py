"""Intel's driver from its wheel: the loader is led to it, beside the drivers of the system."""

from __future__ import annotations

import os
import shutil
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace

import pytest

from rift_cl.cl.build import intel_runtime

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the loader of Linux")


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """An environment with the wheel, a system with two drivers, and a cache folder of our own."""
    library, system = tmp_path / "lib" / "libintelocl.so", tmp_path / "system"
    for path, text in {
        library: "",
        system / "mesa.icd": "libRusticlOpenCL.so.1\n",
        system / "intel64.icd": "/opt/intel/lib/libintelocl.so\n",
    }.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    listed = SimpleNamespace(name=library.name, locate=lambda: library)
    found = SimpleNamespace(files=[listed])
    monkeypatch.setattr(intel_runtime, "distribution", lambda name: found)
    monkeypatch.setattr(intel_runtime, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(intel_runtime, "_SYSTEM", system)
    for name in intel_runtime._CHOICES:
        # Set first, so that what the test leaves behind is taken back.
        monkeypatch.setenv(name, "")
    return library


def test_the_loader_is_led_to_the_wheel_and_to_the_systems_drivers(wheel):
    intel_runtime.register_intel_runtime()
    folder = Path(os.environ["OCL_ICD_VENDORS"])
    texts = {path.read_text().strip() for path in folder.glob("*.icd")}
    assert texts == {str(wheel), "libRusticlOpenCL.so.1"}


def test_a_driver_that_has_gone_is_forgotten(wheel):
    intel_runtime.register_intel_runtime()
    folder = Path(os.environ.pop("OCL_ICD_VENDORS"))
    (intel_runtime._SYSTEM / "mesa.icd").unlink()
    intel_runtime.register_intel_runtime()
    assert [path.read_text().strip() for path in folder.iterdir()] == [str(wheel)]


@pytest.mark.parametrize("name", intel_runtime._CHOICES)
def test_whoever_names_drivers_has_chosen(wheel, monkeypatch, name):
    monkeypatch.setenv(name, "/elsewhere")
    intel_runtime.register_intel_runtime()
    assert [os.environ[each] for each in intel_runtime._CHOICES if os.environ[each]] == [
        "/elsewhere"
    ]


def test_without_the_wheel_nothing_is_changed(wheel, monkeypatch):
    def absent(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(intel_runtime, "distribution", absent)
    intel_runtime.register_intel_runtime()
    assert not os.environ["OCL_ICD_VENDORS"]


def test_where_no_file_can_be_written_the_other_drivers_are_left(wheel, monkeypatch, tmp_path):
    (tmp_path / "vendors").write_text("a file, no folder")
    intel_runtime.register_intel_runtime()
    assert not os.environ["OCL_ICD_VENDORS"]


def test_a_folder_with_a_space_is_told_and_left_out(wheel, monkeypatch):
    folder = wheel.parent.parent / "my environment"
    wheel.parent.rename(folder)
    listed = SimpleNamespace(name=wheel.name, locate=lambda: folder / wheel.name)
    found = SimpleNamespace(files=[listed])
    monkeypatch.setattr(intel_runtime, "distribution", lambda name: found)
    with pytest.warns(UserWarning, match="space in its path"):
        intel_runtime.register_intel_runtime()
    assert not os.environ["OCL_ICD_VENDORS"]


def test_a_folder_that_was_cleared_is_written_again_for_a_child(wheel, monkeypatch, tmp_path):
    intel_runtime.register_intel_runtime()
    folder = Path(os.environ["OCL_ICD_VENDORS"])
    shutil.rmtree(folder)
    intel_runtime.renew_intel_runtime()
    assert folder.is_dir()
    # A folder that somebody else chose is none of ours.
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path / "theirs"))
    intel_runtime.renew_intel_runtime()
    assert not (tmp_path / "theirs").exists()
