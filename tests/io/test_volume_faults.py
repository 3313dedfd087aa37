"""Full disks, wrong places and sudden ends leave the old volume or none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from volume_files import FORMATS, VOLUME, left, save

from rift_cl.errors import (
    FileFormatError,
    OutputError,
)
from rift_cl.io import read_volume


@FORMATS
@pytest.mark.parametrize("place", ["file/v", "nowhere/v", "/proc/v"])
def test_places_where_nothing_can_be_written(tmp_path: Path, format: str, place: str) -> None:
    (tmp_path / "file").touch()
    path = tmp_path / place
    with pytest.raises(OutputError) as caught:
        save(path, format)
    assert str(path) in str(caught.value)
    assert left(tmp_path) == ["file"]


@FORMATS
def test_the_wrong_kind_of_thing_is_there(tmp_path: Path, format: str) -> None:
    path = tmp_path / "v"
    if format in ("h5", "mrc", "tiff-stack"):
        path.mkdir()
    else:
        path.write_text("mine")
    with pytest.raises(OutputError, match=r"v: is a (file|folder)"):
        save(path, format)
    assert left(tmp_path) == ["v"]


@pytest.mark.parametrize("format", ["tiff", "zarr"])
@pytest.mark.parametrize("name", ["v", "v.part", "v.old"])
def test_a_folder_of_somebody_else_is_kept(tmp_path: Path, format: str, name: str) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "thesis.txt").write_text("years")
    with pytest.raises(OutputError, match=r"thesis\.txt"):
        save(tmp_path / "v", format)
    assert (tmp_path / name / "thesis.txt").read_text() == "years"


@pytest.mark.parametrize("names", [["2023", "2024"], ["c"], ["1.txt", "zarr.json"]])
def test_a_folder_that_resembles_a_store_is_kept(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        (tmp_path / "v" / name).mkdir(parents=True)
    with pytest.raises(OutputError, match="replaced"):
        save(tmp_path / "v", "zarr")
    assert left(tmp_path / "v") == names


@FORMATS
def test_too_little_room(tmp_path: Path, format: str, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type("usage", (), {"free": 1000})
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage)
    with pytest.raises(OutputError, match=r"v: needs 8\d.* KiB, the disk has 1e\+03 B free|1000 B"):
        save(tmp_path / "v", format)
    assert left(tmp_path) == []


@pytest.mark.parametrize(
    ("format", "step"),
    [
        ("tiff", "os.fsync"),
        ("tiff", "pathlib.Path.replace"),
        ("tiff", "pathlib.Path.rename"),
        ("zarr", "os.fsync"),
        ("zarr", "pathlib.Path.rename"),
        ("h5", "os.fsync"),
        ("h5", "pathlib.Path.replace"),
        ("mrc", "os.fsync"),
        ("tiff-stack", "pathlib.Path.replace"),
    ],
)
def test_the_last_steps_fail(
    tmp_path: Path, format: str, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path / "v", format)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(step, full)
    with pytest.raises(OutputError, match="No space left"):
        save(tmp_path / "v", format, VOLUME + 1)
    monkeypatch.undo()
    assert left(tmp_path) == ["v"]
    np.testing.assert_array_equal(read_volume(tmp_path / "v"), VOLUME)


@FORMATS
@pytest.mark.parametrize("reserve", ["reserved", "not reserved"])
def test_a_disk_that_is_really_full(
    small_disk: Path, format: str, reserve: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The check before is told that there is room, so that the writing itself fails."""
    usage = type("usage", (), {"free": 1 << 40})
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage)
    if reserve == "not reserved":
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
    noise = np.random.default_rng(1).random((8, 100, 100), dtype=np.float32)
    with pytest.raises(OutputError, match="small/"):
        save(small_disk / "v", format, noise)
    assert left(small_disk) == []


KILLED = """
import sys, numpy as np
from rift_cl.io import open_volume
with open_volume(sys.argv[1], (5, 6, 7), format=sys.argv[2], spacing=1) as writer:
    writer.write(0, np.ones((4, 6, 7)))
    print("written", flush=True)
    sys.stdin.read()
"""


@FORMATS
def test_killed_in_the_middle(tmp_path: Path, format: str) -> None:
    for name in ("new", "old"):
        if name == "old":
            save(tmp_path / name, format)
        command = [sys.executable, "-c", KILLED, str(tmp_path / name), format]
        root = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=root
        ) as writer:
            assert writer.stdout is not None and writer.stdout.readline() == b"written\n"
            writer.send_signal(signal.SIGKILL)
    assert left(tmp_path) == ["new.part", "old", "old.part"]
    np.testing.assert_array_equal(read_volume(tmp_path / "old"), VOLUME)
    if format == "zarr":
        with pytest.raises(FileFormatError, match="was cut off"):
            read_volume(tmp_path / "new.part")
    save(tmp_path / "new", format)
    np.testing.assert_array_equal(read_volume(tmp_path / "new"), VOLUME)
    assert left(tmp_path) == ["new", "old", "old.part"]
