"""Folders of photographs as people have them: other files, duplicates, masks, upright phones."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import capture_files as made
import numpy as np
import pytest
from photograph_files import NAMES, run
from PIL import Image, ImageOps
from view_files import store

from rift_cl.commands.cameras.fit_cameras import save_fit_cameras
from rift_cl.errors import InputError, PathEscapeError
from rift_cl.io import open_capture, pose_photographs, read_image, read_view
from rift_cl.io.captures.photograph_folder import (
    other_files,
    photograph_names,
    photographs_in,
    unread_photographs,
)
from rift_cl.io.captures.transforms_json import open_transforms

ODD = [".DS_Store", "._a b.png", "IMG_1.AAE", "IMG_1.MOV", "Thumbs.db", "notes.txt"]


def test_other_files_are_told_apart_from_photographs_and_masks(folder: Path) -> None:
    unread = ["IMG_1.CR3", "IMG_2.webp"]
    for name in [*ODD, *unread]:
        (folder / name).write_bytes(b"odd")
    made.photographs(folder, ["c_mask.png", "d_mask.png"])
    (folder / "small").mkdir()
    place = photographs_in(folder)
    # d_mask.png belongs to no photograph, so it is one.
    assert photograph_names(place) == sorted([*NAMES, "d_mask.png"])
    assert other_files(place) == sorted(ODD)
    assert unread_photographs(place) == unread


def test_a_folder_of_raw_files_alone_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "DSC_1.NEF").write_bytes(b"odd")
    with pytest.raises(InputError, match=r"DSC_1\.NEF is of a format .* PNG or JPEG"):
        open_capture(tmp_path)


def test_damaged_ones_and_duplicates_are_left_out_and_named(
    folder: Path, tmp_path: Path, seen: Callable
) -> None:
    shutil.copy(folder / "c.PNG", folder / "c (1).png")
    (folder / "d.jpg").write_bytes(b"\xff\xd8\xff\xe0 cut short")
    for name in ODD:
        (folder / name).write_bytes(b"odd")
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert posed.placed == tuple(NAMES)
    assert set(posed.missing) == {"c (1).png", "d.jpg"}
    assert posed.missing["c (1).png"] == "is the same photograph as c.PNG"


def test_of_copies_one_with_a_mask_is_kept(folder: Path, tmp_path: Path, seen: Callable) -> None:
    for name in ("c (1).png", "c (2).png", "b.png"):
        shutil.copy(folder / "c.PNG", folder / name)
    made.photographs(folder, ["c (1)_mask.png"])
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert set(posed.missing) == {"c.PNG", "c (2).png", "b.png"}
    assert set(posed.missing.values()) == {"is the same photograph as c (1).png"}
    masks = {view.name: view.mask for view in open_capture(posed.model, images=folder).views}
    assert masks["c (1).png"] == folder / "c (1)_mask.png"


@pytest.mark.parametrize(
    "mask", ["masks/c.PNG.png", "masks/c.png", "bare/c_mask.png", "masks/c.PNG.png masks/c.png"]
)
def test_masks_of_bare_photographs_are_found_by_name(
    tmp_path: Path, seen: Callable, mask: str
) -> None:
    folder = tmp_path / "capture"
    made.photographs(folder / "images", NAMES)
    for name in mask.replace("bare", "images").split():
        made.photographs(folder / Path(name).parent, [Path(name).name])
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert posed.placed == tuple(NAMES)
    first = folder / mask.replace("bare", "images").split()[0]
    masks = [view.mask for view in open_capture(posed.model, images=folder).views]
    assert masks == [None, first, None, None]


@pytest.mark.parametrize("mask", ["masks/a.png.png", "masks/a.png", "images/a_mask.png"])
def test_masks_of_a_transforms_json_are_found_by_name(tmp_path: Path, mask: str) -> None:
    made.photographs(tmp_path / "images", ["a.png", "b.png"])
    frames = [
        {"file_path": f"images/{name}.png", "transform_matrix": made.opengl(k)}
        for k, name in enumerate("ab")
    ]
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({"fl_x": 20.0, "frames": frames}))
    assert [view.mask for view in open_capture(path).views] == [None, None]
    made.photographs(tmp_path / Path(mask).parent, [Path(mask).name])
    assert [view.mask for view in open_capture(path).views] == [tmp_path / mask, None]


def test_a_mask_that_leads_out_of_the_capture_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "capture"
    made.photographs(folder / "images", ["a.png", "b.png"])
    made.photographs(tmp_path / "elsewhere", ["a.png"])
    frames = [{"file_path": "images/a.png", "transform_matrix": made.opengl(0)}]
    path = folder / "transforms.json"
    path.write_text(json.dumps({"fl_x": 20.0, "frames": frames}))
    (folder / "masks").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(PathEscapeError, match="outside"):
        open_capture(path)


def test_phones_that_are_held_upright_give_upright_views(tmp_path: Path, seen: Callable) -> None:
    """Stored 8 wide and 12 high, shown 12 wide and 8 high, as the stand-in's camera is."""
    folder, codes = tmp_path / "bare", np.zeros((12, 8, 3), np.uint8)
    codes[:6, :4] = 255
    folder.mkdir()
    for number in range(4):
        codes[-1, -1] = 10 * number
        store(folder / f"{number}.png", codes, "uint8", Orientation=6)
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    assert seen()["names"] == [f"{number}.png.png" for number in range(4)]
    for view in open_capture(posed.model, images=folder).views:
        image = read_view(view)
        assert image.shape == (8, 12, 3)
        assert image[:4, 6:].min() == 1 and image[4:, :6].max() < 0.2


def test_a_folder_that_holds_a_video_alone_says_how_to_name_it(tmp_path: Path) -> None:
    (tmp_path / "walk.MOV").write_bytes(b"video")
    with pytest.raises(InputError, match=r"walk\.MOV"):
        open_capture(tmp_path)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_squares_are_posed_and_read_as_they_are_shown(
    tmp_path: Path, seen: Callable, monkeypatch: pytest.MonkeyPatch, orientation: int
) -> None:
    """What the program that finds poses sees is what is read with them; also from a fit's files."""
    monkeypatch.setenv("FAKE_PYCOLMAP_SIZE", "12 12")
    monkeypatch.setattr("rift_cl.io.captures.photographs._FOLDERS", ("models",))
    folder, fit = tmp_path / "bare", tmp_path / "fit"
    folder.mkdir()
    for number in range(4):
        codes = np.random.default_rng(number).integers(0, 256, (12, 12, 3)).astype(np.uint8)
        store(folder / f"{number}.png", codes, "uint8", Orientation=orientation)
    _, posed = run(pose_photographs(folder, fit / "poses"))
    given = Path(seen()["images"].replace("poses.part", "poses"))
    capture = open_capture(posed.model, images=folder)
    save_fit_cameras(fit, capture, capture.views, ())
    reopened = open_transforms(fit / "transforms.json", images=photographs_in(folder))
    for name, *views in zip(seen()["names"], capture.views, reopened.views, strict=True):
        with Image.open(views[0].image) as stored:
            shown = np.asarray(ImageOps.exif_transpose(stored)) / np.float32(255)
        for image in (read_image(given / name), *map(read_view, views)):
            np.testing.assert_allclose(image, shown, atol=1e-6)
