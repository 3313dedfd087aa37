"""Drivers that are not installed: what cannot be had, or shows no device, is told in a sentence."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


def test_a_package_that_cannot_be_had_is_told(tool, tmp_path, monkeypatch, capsys):
    unpacked, driver = tool("portability.unpacked"), tool("try_driver")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(unpacked.UnpackError, match="Debian"):
        unpacked.unpack("oclgrind", tmp_path / "drivers")
    assert driver.main(driver.Options("oclgrind", folder=tmp_path / "drivers")) == 2
    assert "apt-cache" in capsys.readouterr().err


def test_a_driver_without_a_device_is_not_passed_by_pocl(tool, tmp_path, monkeypatch, capsys):
    driver = tool("try_driver")
    library = tmp_path / "usr" / "lib" / "libRusticlOpenCL.so.1"
    library.parent.mkdir(parents=True)
    library.write_text("no library")
    monkeypatch.setattr(driver, "unpack", lambda package, folder, suite="": tmp_path)
    alone = subprocess.run(
        [sys.executable, "-c", "import rift_cl; print(len(rift_cl.devices()))"],
        env={**driver.os.environ, **driver._environment(driver._DRIVERS["rusticl"], tmp_path)[1]},
        capture_output=True,
        text=True,
        check=True,
    )
    if int(alone.stdout) > 1:
        pytest.skip("another driver is beside PoCL's wheel")
    assert driver.main(driver.Options("rusticl", folder=tmp_path)) == 2
    assert "no device" in capsys.readouterr().err


def test_python_runs_on_another_c_library_with_its_packages_and_so_do_its_children(tool, tmp_path):
    unpacked, (loader, libc) = tool("portability.unpacked"), _c_library()
    folder = tmp_path / "usr" / "lib"
    folder.mkdir(parents=True)
    for library in (loader, libc):
        (folder / library.name).symlink_to(library)
    program = unpacked.python_under(tmp_path)
    ask = "import subprocess, sys; import rift_cl; print(sys.executable); "
    ask += "subprocess.run([sys.executable, '-c', 'import sys; print(sys.executable)'], check=True)"
    paths = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "PYTHONUNBUFFERED": "1"}
    command, env = [str(program), "-c", ask], {**os.environ, **paths}
    said = subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout
    assert said.split() == [str(program)] * 2
    with pytest.raises(unpacked.UnpackError, match="no C library"):
        unpacked.python_under(tmp_path / "nothing")


def _c_library() -> tuple[Path, Path]:
    """This process's loader and C library."""
    maps = Path("/proc/self/maps")
    if not maps.is_file():
        pytest.skip("no C library of Linux here")
    found = {Path(line.split()[-1]) for line in maps.read_text().splitlines() if ".so" in line}
    loaders = [path for path in found if path.name.startswith("ld-linux")]
    libraries = [path for path in found if path.name.startswith("libc.so")]
    if not (loaders and libraries):
        pytest.skip("another C library than GNU's")
    return loaders[0], libraries[0]


def test_a_file_that_a_driver_wants_in_one_place_is_told_with_what_helps(
    tool, tmp_path, monkeypatch
):
    driver = tool("try_driver")
    for name in ("nowhere/at/all.spv", "lib.so"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    monkeypatch.setattr(driver, "unpack", lambda package, folder, suite="": tmp_path)
    wants = driver._Driver("some-icd", "lib.so", {}, ("nowhere/at/all.spv",))
    with pytest.raises(
        driver.UnpackError, match=rf"some-icd.*ln -s {tmp_path}.*all.spv /nowhere/at"
    ):
        driver._environment(wants, tmp_path)
