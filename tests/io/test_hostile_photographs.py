"""Folders of photographs that somebody else filled: damaged ones are left out and named."""

from __future__ import annotations

import os
import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import capture_files as made
import numpy as np
import pytest
from photograph_files import NAMES, run
from view_files import store

from rift_cl.errors import InputError, PathEscapeError
from rift_cl.io import open_capture, pose_photographs


def giant() -> bytes:
    """A PNG of a few bytes that claims a million rows and columns."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    head = struct.pack(">IIBBBBB", 1_000_000, 1_000_000, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


DAMAGED: dict[str, bytes] = {
    "empty.png": b"",
    "text.jpg": b"no picture",
    "giant.png": giant(),
    "cut.png": made.png(0)[:-40],
    "mark.jpg": b"\xff\xd8\xff",
    "other.exr": made.png(1),
}


def test_damaged_photographs_are_left_out_and_named(
    folder: Path, tmp_path: Path, seen: Callable[[], dict[str, Any]]
) -> None:
    for name, content in DAMAGED.items():
        (folder / name).write_bytes(content)
    store(folder / "five.tif", np.zeros((4, 4, 5), np.float32), "float")
    store(folder / "nan.exr", np.full((8, 12, 3), np.nan, np.float32), "float")
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert posed.placed == tuple(NAMES)
    assert set(posed.missing) == {*DAMAGED, "five.tif", "nan.exr"}
    for reason in posed.missing.values():
        assert str(folder) not in reason and "\n" not in reason and 0 < len(reason) < 500
    assert [view.name for view in open_capture(posed.model, images=folder).views] == NAMES


def test_too_few_whole_photographs_say_what_was_wrong(
    folder: Path, tmp_path: Path, seen: Callable[[], dict[str, Any]]
) -> None:
    for name in NAMES[1:]:
        (folder / name).write_bytes(giant())
    with pytest.raises(InputError, match=r"1 of 4 photographs.*c\.PNG") as caught:
        run(pose_photographs(folder, tmp_path / "poses"))
    assert "\n" not in str(caught.value) and not list(tmp_path.glob("poses*"))


def test_names_that_no_model_can_hold(
    folder: Path, tmp_path: Path, seen: Callable[[], dict[str, Any]]
) -> None:
    names = ["a\nb.png", "a\\b.png", os.fsdecode(b"\xff.png")]
    made.photographs(folder, names)
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert posed.placed == tuple(NAMES) and len(posed.missing) == 3


def test_folders_pipes_and_hidden_files_are_no_photographs(
    folder: Path, tmp_path: Path, seen: Callable[[], dict[str, Any]]
) -> None:
    (folder / "folder.png").mkdir()
    made.photographs(folder / "folder.png", ["inner.png"])
    os.mkfifo(folder / "pipe.png")
    made.photographs(folder, ["._c.png"])
    (folder / "notes.txt").write_text("")
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert posed.placed == tuple(NAMES) and not posed.missing


def test_no_code_is_loaded_from_where_we_are(
    folder: Path,
    tmp_path: Path,
    seen: Callable[[], dict[str, Any]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for place in (folder, tmp_path / "here"):
        place.mkdir(exist_ok=True)
        for module in ("json", "pycolmap", "importlib", "pathlib"):
            (place / f"{module}.py").write_text("raise SystemExit(66)\n")
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr("sys.path", [entry for entry in sys.path if entry])
    assert run(pose_photographs(folder, tmp_path / "poses"))[1].placed == tuple(NAMES)


def test_links_that_lead_out_of_the_folder_are_refused(
    folder: Path, tmp_path: Path, seen: Callable[[], dict[str, Any]]
) -> None:
    made.photographs(tmp_path, ["secret.png"])
    (folder / "kept").mkdir()
    (folder / "kept" / "e.png").write_bytes(made.png(9))
    (folder / "inside.png").symlink_to("kept/e.png")
    (folder / "broken.png").symlink_to("gone.png")
    assert "inside.png" in run(pose_photographs(folder, tmp_path / "poses"))[1].placed
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(PathEscapeError, match="outside the folder"):
        run(pose_photographs(folder, tmp_path / "poses"))
