"""Files appear complete or not at all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl.errors import InputError, OutputError
from rift_cl.io import atomic_path, make_folder, write_json, write_png, write_text


def left(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_the_name_appears_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with atomic_path(path) as part:
        assert part.parent == tmp_path
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert left(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_what_was_there(tmp_path: Path, kind: type[BaseException]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(kind, match="mine"), atomic_path(path) as part:
        part.write_text("half")
        raise kind("mine")
    assert path.read_text() == "old"
    assert left(tmp_path) == ["a.txt"]


def test_a_block_that_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"a\.txt"), atomic_path(tmp_path / "a.txt"):
        pass


@pytest.mark.parametrize("place", ["file/a.png", "nowhere/a.png", "/proc/a.png", "folder.png"])
def test_places_where_nothing_can_be_written(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    path = tmp_path / place
    for write in (
        lambda: write_text(path, "x"),
        lambda: write_json(path, {}),
        lambda: write_png(path, np.zeros((4, 4))),
    ):
        with pytest.raises(OutputError) as caught:
            write()
        assert str(caught.value).startswith(f"{path}: ")
    assert left(tmp_path) == ["file", "folder.png"]


@pytest.mark.parametrize("step", ["os.fsync", "pathlib.Path.replace"])
def test_the_last_steps_fail(tmp_path: Path, step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(step, full)
    with pytest.raises(OutputError, match="No space left"):
        write_text(path, "new")
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert left(tmp_path) == ["a.txt"]


def test_a_disk_that_is_really_full(small_disk: Path) -> None:
    """A PNG on a full disk counts as written unless the last error is asked for."""
    noise = np.random.default_rng(1).integers(0, 256, (300, 300), dtype=np.uint8)
    with pytest.raises(OutputError, match=r"small/a\.png: "):
        write_png(small_disk / "a.png", noise)
    with pytest.raises(OutputError, match=r"small/a\.txt: .*No space left"):
        write_text(small_disk / "a.txt", "x" * 100_000)
    assert left(small_disk) == []


def test_json(tmp_path: Path) -> None:
    value = {
        "psnr": np.float32(31.5),
        "best": np.inf,
        "curve": np.array([1, np.nan]),
        "n": np.int64(3),
        "path": Path("a"),
        "name": "Zürich",
        "pair": (1, True),
        5: None,
    }
    write_json(tmp_path / "a.json", value)
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    assert json.loads(text) == {
        "psnr": 31.5,
        "best": None,
        "curve": [1, None],
        "n": 3,
        "path": "a",
        "name": "Zürich",
        "pair": [1, True],
        "5": None,
    }
    assert text.endswith("}\n")


@pytest.mark.parametrize("value", [object(), {"a": {1, 2}}, [1j]])
def test_what_json_cannot_say(tmp_path: Path, value: object) -> None:
    with pytest.raises(InputError, match="JSON"):
        write_json(tmp_path / "a.json", value)
    assert left(tmp_path) == []


def test_a_name_that_is_not_utf8_comes_back(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9")
    write_json(tmp_path / "a.json", {"name": name})
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == {"name": name}


def test_folders(tmp_path: Path) -> None:
    assert make_folder(tmp_path / "a" / "b").is_dir()
    assert make_folder(tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file"):
        make_folder(tmp_path / "file" / "b")


def test_the_package_is_light() -> None:
    check = (
        "import sys, rift_cl.io;"
        "print({'h5py', 'zarr', 'OpenImageIO', 'pyopencl'} & set(sys.modules))"
    )
    root = str(Path(__file__).parents[2])
    done = subprocess.run(
        [sys.executable, "-c", check], capture_output=True, text=True, check=True, cwd=root
    )
    assert done.stdout.strip() == "set()"
