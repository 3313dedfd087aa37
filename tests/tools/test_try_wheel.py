"""What try_wheel.py finds in a wheel and in a source distribution."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile

import pytest


def wheel_of(tool, path, *, more=(), left_out=()):
    module = tool("try_wheel")
    names = [
        f"rift_cl/{p.relative_to(module.ROOT)}" for p in (module.ROOT / "kernels").rglob("*.[ch]*")
    ]
    names += [str(p.relative_to(module.ROOT)) for p in (module.ROOT / "rift_cl").rglob("*.py")]
    with zipfile.ZipFile(path, "w") as archive:
        for name in {*names, "rift_cl-0.1.0.dist-info/METADATA", *more} - {*left_out}:
            archive.writestr(name, "x")
    return path


def test_a_wheel_as_it_should_be_has_no_fault(tool, tmp_path):
    path = wheel_of(tool, tmp_path / "a.whl")
    assert tool("try_wheel").wheel_faults(path) == []
    assert set(tool("try_wheel").parts_of(path)) >= {"rift_cl/kernels", "rift_cl/io"}


@pytest.mark.parametrize(
    ("more", "left_out", "fault"),
    [
        (["tests/test_a.py"], [], "holds tests"),
        (["rift_cl/tools/a.py"], [], "holds rift_cl/tools/a.py"),
        ([], ["rift_cl/kernels/vector/clip_negative.cl"], "lacks rift_cl/kernels/vector/clip"),
    ],
)
def test_what_is_wrong_with_a_wheel_is_named(tool, tmp_path, more, left_out, fault):
    path = wheel_of(tool, tmp_path / "a.whl", more=more, left_out=left_out)
    assert any(fault in each for each in tool("try_wheel").wheel_faults(path))


def test_a_source_distribution_without_tests_is_named(tool, tmp_path):
    path = tmp_path / "a.tar.gz"
    with tarfile.open(path, "w:gz") as archive:
        archive.add(__file__, "rift_cl-0.1.0/rift_cl/a.py")
    assert any("lacks tests" in fault for fault in tool("try_wheel").sdist_faults(path))


def test_what_fails_in_an_environment_is_said(tool, tmp_path):
    said = tool("try_wheel").tried("/no/such/python", tmp_path / "a.whl", tmp_path / "env")
    assert "no/such/python" in said


def test_the_smoke_test_runs_here(tool, tmp_path):
    code = tool("try_wheel").SMOKE
    subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=tmp_path, check=True)
    assert (tmp_path / "scan.npz").is_file()
