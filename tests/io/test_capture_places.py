"""Masks lie beside the photographs, and photographs may lie far from the model of their poses."""

from __future__ import annotations

from pathlib import Path

import capture_files as made
import pytest

from rift_cl.errors import InputError, PathEscapeError
from rift_cl.io import open_capture


def test_masks(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    made.photographs(tmp_path / "masks")
    made.changed(path, 1, mask_path="masks/a.png")
    assert [view.mask for view in open_capture(path).views] == [
        None,
        tmp_path / "masks" / "a.png",
        None,
    ]


def test_masks_of_a_colmap_model(tmp_path: Path) -> None:
    made.photographs(tmp_path / "images")
    made.colmap_text(tmp_path / "sparse")
    made.photographs(tmp_path / "masks", ["a.png.png", "sub/c.png"])
    masks = [view.mask for view in open_capture(tmp_path).views]
    assert masks == [tmp_path / "masks" / "a.png.png", None, tmp_path / "masks" / "sub" / "c.png"]


@pytest.mark.each
@pytest.mark.parametrize("folder", ["masks", "mask"])
@pytest.mark.parametrize("name", ["a.jpg", "a.png.jpg", "a.jpeg", "a.tif", "a.tiff"])
def test_masks_of_other_formats_and_folders(tmp_path: Path, folder: str, name: str) -> None:
    path = made.transforms(tmp_path)
    made.photographs(tmp_path / folder, [name])
    found = [view.mask for view in open_capture(path).views]
    assert found == [tmp_path / folder / name, None, None]
    made.photographs(tmp_path / "masks", ["a.png"])
    assert open_capture(path).views[0].mask == tmp_path / "masks" / "a.png"


@pytest.mark.parametrize("below", ["", "images"])
@pytest.mark.parametrize("write", [made.colmap_binary, made.colmap_text])
def test_a_model_far_from_its_photographs(tmp_path: Path, below: str, write: type) -> None:
    photographs, model = tmp_path / "far" / "photographs", write(tmp_path / "poses")
    made.photographs(photographs / below)
    made.photographs(photographs / "masks", ["b.png"])
    with pytest.raises(InputError, match="is not in"):
        open_capture(model)
    for given in (photographs, photographs / "x" / ".."):
        views = open_capture(model, images=given).views
        assert [view.image for view in views] == [photographs / below / n for n in made.NAMES]
        assert [view.mask for view in views] == [None, photographs / "masks" / "b.png", None]


def test_names_of_a_model_stay_in_the_folder_that_was_given(tmp_path: Path) -> None:
    made.photographs(tmp_path / "here")
    made.photographs(tmp_path, ["a.png"])
    model = made.colmap_text(tmp_path / "poses")
    lines = (model / "images.txt").read_text().replace("a.png", "../a.png")
    (model / "images.txt").write_text(lines)
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_capture(model, images=tmp_path / "here")
    (tmp_path / "here" / "link.png").symlink_to(tmp_path / "a.png")
    (model / "images.txt").write_text(lines.replace("../a.png", "link.png"))
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_capture(model, images=tmp_path / "here")
