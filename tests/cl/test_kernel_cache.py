"""The folder of compiled kernels: ours alone, emptied on request, and checked before it is used."""

from __future__ import annotations

import os
import shutil
import stat
import sys
from pathlib import Path

import pytest

from rift_cl import __version__
from rift_cl.cl.build import cache_check, kernel_cache
from rift_cl.errors import DeviceError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="PoCL's cache, on Linux")

# Two small kernels, built or loaded, and run.
PROGRAM = """
import numpy as np, rift_cl as rift
def works(device):
    x, y = device.array(np.ones((4, 4))), device.zeros((4, 4))
    device.launch("plane_split", (4, 4, 1), image=x, plane=y, slice0=0, rows=4, width=4, margin=0)
    planes = {"by_rows": x, "by_columns": x, "row_pitch": 4, "column_pitch": 4}
    device.launch("plane_merge", (4, 4, 1), **planes, image=y, slice0=0, ny=4, nx=4)
    return bool((device.get(y) == 2).all())
device = rift.open_device("pocl")
print(works(device))
"""
DAMAGES = {
    "emptied": lambda data: b"",
    "cut": lambda data: data[: len(data) // 2],
    "flipped": lambda data: bytes(b ^ 255 if i % 997 == 3 else b for i, b in enumerate(data)),
}
FILES = ("program.bc", "plane_split.so", "plane_merge.so")


def _works(done):
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "True", "")


@pytest.fixture(scope="module")
def warm(python, tmp_path_factory):
    """A cache that one run has filled."""
    root = tmp_path_factory.mktemp("warm")
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(root)))
    return root


@pytest.fixture
def cache(warm, tmp_path):
    root = tmp_path / "cache"
    shutil.copytree(warm, root)
    return root


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache for the functions of this process (its drivers keep the one they have)."""
    kernel_cache.cache_folder.cache_clear()
    monkeypatch.setenv("RIFT_CACHE_DIR", str(tmp_path / "root"))
    monkeypatch.setenv("POCL_CACHE_DIR", "put back afterwards")
    yield kernel_cache.cache_folder()
    kernel_cache.cache_folder.cache_clear()


def _files(root):
    found = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    return {path: data for path, data in found.items() if data and path.suffix in (".bc", ".so")}


@pytest.mark.full
def test_cache_is_closed_to_others(warm):
    folder = warm / "rift_cl" / __version__
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert folder.stat().st_uid == os.getuid()
    assert _files(folder)


def test_folders_that_were_there_keep_their_mode(tmp_path, monkeypatch):
    tmp_path.chmod(0o755)
    monkeypatch.setenv("RIFT_CACHE_DIR", str(tmp_path))
    kernel_cache.cache_folder.cache_clear()
    monkeypatch.setenv("POCL_CACHE_DIR", "put back afterwards")
    try:
        assert kernel_cache.cache_folder() == tmp_path / "rift_cl" / __version__
    finally:
        kernel_cache.cache_folder.cache_clear()
    assert stat.S_IMODE(tmp_path.stat().st_mode) == 0o755


def test_loose_mode_is_tightened(cache, python):
    folder = cache / "rift_cl" / __version__
    folder.chmod(0o777)
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_second_run_builds_nothing(cache, python):
    before = _files(cache)
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))
    assert _files(cache) == before


@pytest.mark.full
def test_a_driver_keeps_programs_whoever_asked_before(cache, python):
    code = (
        "from rift_cl.cl.build.driver_record import forget_record, keeps_programs\n"
        "for _ in range(2):\n"
        "    forget_record(device.identity)\n"
        "    print(keeps_programs(device.identity, device.context))\n"
    )
    done = python(PROGRAM + code, RIFT_CACHE_DIR=str(cache))
    assert done.stdout.split() == ["True"] * 3, done.stderr


def test_clearing_frees_what_it_says_and_spares_the_rest(folder):
    root = folder.parents[1]
    (root / "mine.txt").write_text("a person's own file")
    (folder / "AB" / "CDE").mkdir(parents=True)
    (folder / "AB" / "CDE" / "program.bc").write_bytes(bytes(1000))
    (folder / "tempfile_x").write_bytes(bytes(24))
    assert kernel_cache.cache_size() == 1024
    assert kernel_cache.clear_cache() == 1024 - kernel_cache.cache_size()
    assert not list(folder.rglob("*.bc"))
    assert (root / "mine.txt").exists()


@pytest.mark.full
def test_next_run_after_clearing_works_in_the_same_process_and_in_another(cache, python):
    again = (
        "from rift_cl.cl.build.kernel_cache import cache_size, clear_cache\n"
        "print(clear_cache() > 10_000, cache_size() < 100)\n"
        "print(works(rift.Device(device._handle, device.selector)))\n"
    )
    done = python(PROGRAM + again, RIFT_CACHE_DIR=str(cache))
    assert done.stdout.split() == ["True"] * 4, done.stderr
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))


@pytest.mark.full
def test_cache_that_is_deleted_under_a_running_process(cache, python):
    code = (
        "import shutil, rift_cl as rift\n"
        "from rift_cl.cl.build.kernel_cache import cache_folder\n"
        "rift.open_device('pocl').context\n"
        "shutil.rmtree(cache_folder().parents[1])\n"
    )
    _works(python(code + PROGRAM, RIFT_CACHE_DIR=str(cache)))


def _one(cache, name):
    """A file of the programs above, and not of the one that looks whether a driver keeps any."""
    found = cache.rglob(name)
    ours = (path for path in found if any(path.parent.rglob("plane_*.so")))
    return sorted(ours if name == "program.bc" else found)[0]


@pytest.mark.full
@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_kernel_is_built_again(cache, python, name, damage):
    path = _one(cache, name)
    whole = path.read_bytes()
    path.write_bytes(DAMAGES[damage](whole))
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))
    assert path.stat().st_size > len(whole) // 2


@pytest.mark.full
@pytest.mark.parametrize("name", FILES)
def test_missing_file_is_built_again(cache, python, name):
    for path in cache.rglob(name):
        path.unlink()
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))


def _folder_instead(path):
    path.unlink()
    (path / "inside").mkdir(parents=True)


def _pipe_instead(path):
    path.unlink()
    os.mkfifo(path)


OTHERS = {"folder": _folder_instead, "pipe": _pipe_instead}


@pytest.mark.full
@pytest.mark.parametrize("name", [*FILES, "checksums.json", "build.lock"])
@pytest.mark.parametrize("other", OTHERS)
def test_what_is_no_file_is_removed_and_built_again(cache, python, name, other):
    OTHERS[other](next(cache.rglob(name)) if name not in FILES else _one(cache, name))
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))
    assert _one(cache, "program.bc").is_file()


def test_a_record_that_leads_out_of_the_cache_removes_nothing_there(folder):
    outside = folder.parent / "AB" / "P" / "folder"
    outside.mkdir(parents=True)
    cache_check.record(folder)
    record = '{"../AB/P/folder": 1, "AB/../../AB/P/folder": 1}'
    (folder / "checksums.json").write_text(record, encoding="utf-8")
    assert cache_check.remove_damaged(folder) == 0
    assert outside.is_dir()


@pytest.mark.full
def test_damage_to_kernels_and_record_together(cache, python):
    next(cache.rglob("checksums.json")).write_bytes(b"")
    for path in cache.rglob("program.bc"):
        path.write_bytes(b"")
    _works(python(PROGRAM, RIFT_CACHE_DIR=str(cache)))


def _program(folder, name, data):
    path = folder / name / "program.bc"
    path.parent.mkdir(parents=True)
    path.write_bytes(data)
    return path


def test_only_the_damaged_program_is_removed(folder):
    paths = [_program(folder, f"AB/P{number}", bytes([number]) * 9) for number in range(4)]
    cache_check.record(folder)
    paths[1].write_bytes(b"other")
    unknown = _program(folder, "CD/NEW", b"built without our lock")
    assert cache_check.remove_damaged(folder) == 1
    assert [path.exists() for path in paths] == [True, False, True, True]
    assert unknown.exists()
    assert cache_check.remove_damaged(folder) == 0


def test_rebuilt_program_may_differ_from_the_one_before(folder):
    path = _program(folder, "AB/P", b"one")
    cache_check.record(folder)
    path.write_bytes(b"damaged")
    cache_check.remove_damaged(folder)
    _program(folder, "AB/P", b"another")
    cache_check.record(folder)
    assert cache_check.remove_damaged(folder) == 0
    assert path.read_bytes() == b"another"


@pytest.mark.parametrize(
    "content",
    [None, b"", b"[1]", b"\xff\xfe", b"null", b'{"AB/P/program', b"[" * 200_000, b" " * (1 << 25)],
    ids=["none", "empty", "list", "no text", "null", "cut", "nested", "large"],
)
def test_without_a_readable_record_nothing_is_trusted(folder, content):
    path = _program(folder, "AB/P", b"from a run that never ended")
    if content is not None:
        (folder / "checksums.json").write_bytes(content)
    assert cache_check.remove_damaged(folder) == 1
    assert not path.exists()


def test_lock_on_a_folder_that_became_unusable_is_a_named_error(folder):
    shutil.rmtree(folder.parent)
    folder.parent.write_text("a file where the folder was")
    with pytest.raises(DeviceError, match="cannot be used"), kernel_cache.build_lock():
        pytest.fail("the lock cannot be had")


def test_cache_follows_the_users_cache_folder(python, tmp_path):
    code = "from rift_cl.cl.build.kernel_cache import cache_folder; print(cache_folder())"
    done = python(code, RIFT_CACHE_DIR=None, XDG_CACHE_HOME=str(tmp_path / "xdg"))
    assert Path(done.stdout.strip()) == tmp_path / "xdg" / "rift_cl" / __version__
    done = python(code, RIFT_CACHE_DIR=None, XDG_CACHE_HOME=None, HOME=str(tmp_path))
    assert Path(done.stdout.strip()) == tmp_path / ".cache" / "rift_cl" / __version__


def test_a_full_disk_is_told_before_a_compiler_meets_it(tmp_path, monkeypatch):
    """PoCL ends the process where it cannot write what it compiled."""
    assert kernel_cache._private(tmp_path) is not None
    kernel_cache.cache_folder()
    limits = (4096, kernel_cache.resource.RLIM_INFINITY)
    monkeypatch.setattr(kernel_cache.resource, "getrlimit", lambda _: limits)
    assert kernel_cache._private(tmp_path) is None
    with (
        pytest.raises(DeviceError, match=r"4 KiB are left .*RIFT_CACHE_DIR"),
        kernel_cache.build_lock("axpby"),
    ):
        pass
    # Looking after the cache takes no room.
    with kernel_cache.build_lock():
        pass
