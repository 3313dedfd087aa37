"""Bare photographs: which are taken, what COLMAP is told, what is left behind whatever it does.

Where the poses themselves do not matter a stand-in of pycolmap gives them.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import capture_files as made
import numpy as np
import pytest
from photograph_files import NAMES, run
from view_files import display, store

from rift_cl.errors import InputError, OutputError
from rift_cl.io import (
    check_photographs,
    holds_bare_photographs,
    open_capture,
    pose_photographs,
    read_image,
)
from rift_cl.io.images.read_picture import read_picture_header
from rift_cl.progress import Report


def test_photographs_become_a_capture(folder: Path, tmp_path: Path, seen: Callable) -> None:
    reports, posed = run(pose_photographs(folder, tmp_path / "fit" / "poses", seed=5))
    assert posed.model == tmp_path / "fit" / "poses"
    assert posed.placed == tuple(NAMES) and not posed.missing
    capture = open_capture(posed.model, images=folder)
    assert [view.image for view in capture.views] == [folder / name for name in NAMES]
    assert capture.points is not None
    assert seen()["groups"] == [NAMES] and seen()["images"] == str(folder)
    assert seen()["seed"] == 5 and seen()["matched"] == ["all", 5]
    kinds = list(dict.fromkeys(report.what for report in reports))
    assert kinds == [
        "photographs read",
        "photographs searched for features",
        "blocks of pairs matched",
        "photographs placed",
    ]
    assert all(0 < report.done <= report.total for report in reports)


def test_only_the_model_its_record_and_the_log_are_left(
    folder: Path, tmp_path: Path, seen: Callable
) -> None:
    before = sorted(folder.iterdir())
    run(pose_photographs(folder, tmp_path / "poses"))
    left = {path.name for path in (tmp_path / "poses").iterdir()}
    assert left == {"cameras.bin", "images.bin", "points3D.bin", "poses.json", "colmap.log"}
    assert not (tmp_path / "poses.part").exists() and sorted(folder.iterdir()) == before


def test_photographs_may_lie_in_a_folder_images(tmp_path: Path, seen: Callable) -> None:
    made.photographs(tmp_path / "bare" / "images", NAMES)
    made.photographs(tmp_path / "bare" / "masks", ["c.png"])
    made.photographs(tmp_path / "bare", ["thumbnail.png"])
    _, posed = run(pose_photographs(tmp_path / "bare", tmp_path / "poses"))
    assert posed.placed == tuple(NAMES)
    views = open_capture(posed.model, images=tmp_path / "bare").views
    masks = [view.mask for view in views]
    assert masks == [None, tmp_path / "bare" / "masks" / "c.png", None, None]


def test_many_photographs_are_matched_with_their_neighbours(
    folder: Path, tmp_path: Path, seen: Callable
) -> None:
    reports, _ = run(pose_photographs(folder, tmp_path / "poses", exhaustive=3))
    assert seen()["matched"] == ["near", 0]
    assert Report(3, 4, "photographs matched") in reports


def test_finished_work_is_taken_up_again_and_only_that(
    folder: Path, tmp_path: Path, seen: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = tmp_path / "poses"
    first = run(pose_photographs(folder, work))[1]
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert run(pose_photographs(folder, work))[1] == first
    with pytest.raises(InputError, match="not installed"):
        run(pose_photographs(folder, work, seed=1))
    os.utime(folder / NAMES[0], ns=(1, 1))
    with pytest.raises(InputError, match="not installed"):
        run(pose_photographs(folder, work))
    assert open_capture(work, images=folder).views


@pytest.mark.parametrize("content", ["", "[]", "{", '{"photographs": 3}', '{"placed": {}}'])
def test_a_damaged_record_is_no_finished_work(
    folder: Path, tmp_path: Path, seen: Callable, content: str
) -> None:
    run(pose_photographs(folder, tmp_path / "poses"))
    (tmp_path / "poses" / "poses.json").write_text(content)
    assert len(run(pose_photographs(folder, tmp_path / "poses"))[0]) > 1


def test_cameras_are_told_apart_by_size_and_exif(tmp_path: Path, seen: Callable) -> None:
    folder = tmp_path / "bare"
    made.photographs(folder, ["a.png", "b.png"])
    store(folder / "c.png", np.zeros((8, 13, 3), np.uint8), "uint8")
    for name, focal in (("d.jpg", 28), ("e.jpg", 50), ("f.jpg", 28)):
        exif = {"Make": "Acme", "Exif:FocalLengthIn35mmFilm": focal}
        codes = np.full((8, 12, 3), ord(name[0]), np.uint8)
        path = store(folder / name, codes, "uint8", **exif)
        assert len(read_picture_header(path).taken_by) == 2
    run(pose_photographs(folder, tmp_path / "poses"))
    assert seen()["groups"] == [["a.png", "b.png"], ["c.png"], ["d.jpg", "f.jpg"], ["e.jpg"]]


def test_other_kinds_of_picture_are_seen_as_copies_of_8_bits(
    tmp_path: Path, seen: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, kept = tmp_path / "bare", tmp_path / "kept"
    made.photographs(folder, ["a.png"])
    linear = np.linspace(0, 1.2, 8 * 12 * 3, dtype=np.float32).reshape(8, 12, 3)
    store(folder / "b.exr", linear, "float")
    store(folder / "c.tif", linear / 1.2, "uint16")
    half = np.full((8, 12, 4), 0.5, np.float32)
    store(folder / "d.png", half, "uint8", **{"oiio:UnassociatedAlpha": 1})
    keep = lambda path, **_: shutil.copytree(path, kept)  # noqa: E731
    monkeypatch.setattr("rift_cl.io.captures.photographs.shutil.rmtree", _first(keep, "copies"))
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert posed.placed == ("a.png", "b.exr", "c.tif", "d.png")
    assert seen()["names"] == [f"{name}.png" for name in posed.placed]
    expected = {
        "a.png": made.image(0) / 255,
        "b.exr": np.clip(display(linear), 0, 1),
        "c.tif": linear / 1.2,
        "d.png": np.full((8, 12, 3), 0.25),
    }
    for name, colors in expected.items():
        np.testing.assert_allclose(read_image(kept / f"{name}.png"), colors, atol=0.6 / 255)


def _first(also: Callable[..., object], name: str) -> Callable[..., None]:
    """Remove a folder, after something else was done with the one of this name."""
    remove = shutil.rmtree

    def removed(path: Path, **options: Any) -> None:
        if path.name == name and path.exists():
            also(path)
        remove(path, **options)

    return removed


def test_those_without_a_pose_are_named(
    folder: Path, tmp_path: Path, seen: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_PYCOLMAP", f"but {NAMES[2]}")
    for _ in range(2):
        _, posed = run(pose_photographs(folder, tmp_path / "poses"))
        assert posed.placed == (NAMES[0], NAMES[1], NAMES[3])
        assert list(posed.missing) == [NAMES[2]] and "matched" in posed.missing[NAMES[2]]


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("none", "no poses could be found for 4 photographs"),
        ("exit", "status 3"),
        ("raise", r"status 1 \(ValueError: .*a > b\)"),
    ],
)
def test_colmap_fails_in_one_sentence_and_leaves_what_was_there(
    folder: Path,
    tmp_path: Path,
    seen: Callable,
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
    message: str,
) -> None:
    run(pose_photographs(folder, tmp_path / "poses", seed=7))
    monkeypatch.setenv("FAKE_PYCOLMAP", fault)
    with pytest.raises(InputError, match=message) as caught:
        run(pose_photographs(folder, tmp_path / "poses"))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "poses.part").exists()
    assert len(run(pose_photographs(folder, tmp_path / "poses", seed=7))[0]) == 1


def test_whoever_stops_listening_stops_colmap(
    folder: Path, tmp_path: Path, seen: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_PYCOLMAP", "hang")
    work = pose_photographs(folder, tmp_path / "poses")
    while next(work).what != "photographs placed":
        pass
    start = time.monotonic()
    work.close()
    assert time.monotonic() - start < 10
    assert not (tmp_path / "poses.part").exists() and not (tmp_path / "poses").exists()


def test_what_is_missing_is_said_before_anything_is_written(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "two").mkdir()
    for name in NAMES[:2]:
        (folder / name).rename(tmp_path / "two" / name)
    with pytest.raises(InputError, match=r"2 photographs.*3"):
        check_photographs(tmp_path / "two")
    made.photographs(folder, NAMES)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"film,view\]' in the .*or pip install pycolmap"):
        run(pose_photographs(folder, tmp_path / "fit" / "poses"))
    with pytest.raises(InputError, match="no such file"):
        run(pose_photographs(tmp_path / "gone", tmp_path / "fit" / "poses"))
    assert not (tmp_path / "fit").exists()


def test_bare_photographs_are_no_capture_yet(folder: Path, tmp_path: Path) -> None:
    assert holds_bare_photographs(folder)
    with pytest.raises(InputError, match=r"4 bare photographs.*'rift fit'"):
        open_capture(folder)
    with pytest.raises(InputError, match="no COLMAP model"):
        open_capture(folder, images=folder)
    made.colmap_binary(folder)
    assert not holds_bare_photographs(folder)
    assert not holds_bare_photographs(made.transforms(tmp_path / "posed"))
    assert not holds_bare_photographs(tmp_path / "posed")
    (tmp_path / "empty").mkdir()
    assert not holds_bare_photographs(tmp_path / "empty")
    assert not holds_bare_photographs(tmp_path / "gone")


def test_a_folder_with_other_things_is_not_replaced(
    folder: Path, tmp_path: Path, seen: Callable
) -> None:
    for work in (folder, tmp_path / "notes"):
        work.mkdir(exist_ok=True)
        (work / "thesis.txt").write_text("")
        with pytest.raises(OutputError, match="not replaced"):
            run(pose_photographs(folder, work))
    assert len(list(folder.iterdir())) == 5
