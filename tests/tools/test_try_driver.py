"""Drivers that are not installed: what cannot be had, or shows no device, is told in a sentence."""

import subprocess
import sys

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
    monkeypatch.setattr(driver, "unpack", lambda package, folder: tmp_path)
    alone = subprocess.run(
        [sys.executable, "-c", "import rift_cl; print(len(rift_cl.devices()))"],
        env={**driver.os.environ, **driver._environment(driver._DRIVERS["rusticl"], tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    if int(alone.stdout) > 1:
        pytest.skip("another driver is beside PoCL's wheel")
    assert driver.main(driver.Options("rusticl", folder=tmp_path)) == 2
    assert "no device" in capsys.readouterr().err
