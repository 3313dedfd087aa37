"""Full disks, wrong places and wrong names leave the older file of splats or none."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import splat_files as made

import rift_cl as rift
from rift_cl.errors import FileFormatError, InputError, OutputError

FORMATS = pytest.mark.parametrize("ending", ["ply", "splat"])


def left(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


@pytest.mark.parametrize("name", ["a", "a.txt", "a.ply.gz", "ply"])
def test_a_name_that_says_no_format(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"\.ply or \.splat"):
        made.scene().save(tmp_path / name)
    assert left(tmp_path) == []


def test_an_empty_scene_is_no_splat_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="empty"):
        made.scene(0).save(tmp_path / "a.splat")
    assert left(tmp_path) == []


def test_names_in_capitals(tmp_path: Path) -> None:
    for name in ("A.PLY", "A.SPLAT"):
        made.scene().save(tmp_path / name)
        assert len(rift.SplatScene.load(str(tmp_path / name))) == 7


def test_a_ply_is_known_by_its_content_whatever_its_name(tmp_path: Path) -> None:
    made.scene().save(tmp_path / "a.ply")
    (tmp_path / "a.ply").rename(tmp_path / "a.splat")
    made.assert_same(rift.SplatScene.load(tmp_path / "a.splat"), made.scene())
    made.scene().save(tmp_path / "b.splat")
    (tmp_path / "b.splat").rename(tmp_path / "b.ply")
    with pytest.raises(FileFormatError, match=r"b\.ply:.*PLY"):
        rift.SplatScene.load(tmp_path / "b.ply")


def test_things_that_are_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.ply"):
        rift.SplatScene.load(tmp_path / "a.ply")
    os.mkfifo(tmp_path / "pipe.ply")
    for path in (tmp_path, tmp_path / "pipe.ply"):
        with pytest.raises(InputError, match="is not a file"):
            rift.SplatScene.load(path)


@FORMATS
@pytest.mark.parametrize("place", ["file/a", "nowhere/a", "/proc/a", "folder"])
def test_places_where_nothing_can_be_written(tmp_path: Path, ending: str, place: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / f"folder.{ending}").mkdir()
    path = tmp_path / f"{place}.{ending}"
    with pytest.raises(OutputError) as caught:
        made.scene().save(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert left(tmp_path) == ["file", f"folder.{ending}"]


def full(*_: object) -> None:
    raise OSError(28, "No space left on device")


@FORMATS
@pytest.mark.parametrize("step", ["os.fsync", "pathlib.Path.replace", "shutil.disk_usage"])
def test_a_save_that_fails_leaves_the_older_file(
    tmp_path: Path, ending: str, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_text("old")
    monkeypatch.setattr(step, full)
    with pytest.raises(OutputError, match="No space left"):
        made.scene().save(path)
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert left(tmp_path) == [path.name]


@FORMATS
@pytest.mark.parametrize("check", ["before", "while writing"])
def test_a_disk_that_is_really_full(
    small_disk: Path, ending: str, check: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made.scene(10).save(small_disk / f"a.{ending}")
    if check == "while writing":
        usage = type("usage", (), {"free": 1 << 40})
        monkeypatch.setattr("shutil.disk_usage", lambda path: usage)
    words = "the disk has" if check == "before" else "No space left"
    with pytest.raises(OutputError, match=rf"a\.{ending}: .*{words}"):
        made.scene(9000).save(small_disk / f"a.{ending}")
    assert left(small_disk) == [f"a.{ending}"]
    assert len(rift.SplatScene.load(small_disk / f"a.{ending}")) == 10


@FORMATS
def test_a_disk_that_loses_bytes_in_silence(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = {f".{ending}": lambda scene: (100, iter([bytes(99)]))}
    monkeypatch.setattr("rift_cl.io.scenes.splat_scene._ENCODERS", short)
    with pytest.raises(OutputError, match="shorter"):
        made.scene().save(tmp_path / f"a.{ending}")
    assert left(tmp_path) == []
