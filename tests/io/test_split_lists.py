"""nerfstudio's lists of what is trained on and scored, in every mixture."""

from __future__ import annotations

from pathlib import Path

import capture_files as made
import pytest

from rift_cl.errors import FileFormatError
from rift_cl.io import open_capture

A, B, C = (f"images/{name}" for name in ("a.png", "b.png", "sub/c.png"))


@pytest.mark.parametrize(
    ("lists", "wanted", "words"),
    [
        ({}, ["", "", ""], []),
        ({"train_filenames": [], "test_filenames": []}, ["", "", ""], []),
        ({"train_filenames": [A, B]}, ["train", "train", "test"], []),
        ({"test_filenames": [B]}, ["train", "test", "train"], []),
        ({"val_filenames": [B], "test_filenames": [C]}, ["train", "test", "test"], []),
        (
            {"train_filenames": [f"./{A}"], "val_filenames": ["images/b"]},
            ["train", "test", "none"],
            ["1 of 3 photographs are in no list"],
        ),
        (
            {"train_filenames": [A, B, C], "test_filenames": [C]},
            ["train", "train", "test"],
            [f"1 photographs, such as {C}, are listed to be trained"],
        ),
        (
            {"train_filenames": [A, "c.png"], "test_filenames": ["b.png"]},
            ["train", "test", "train"],
            [],
        ),
        (
            {"train_filenames": [A, B], "test_filenames": ["images/d.png"]},
            ["train", "train", "none"],
            ["1 names in the lists of photographs, such as images/d.png", "in no list"],
        ),
    ],
)
def test_lists_say_what_each_photograph_is_for(
    tmp_path: Path, lists: dict[str, list[str]], wanted: list[str], words: list[str]
) -> None:
    capture = open_capture(made.transforms(tmp_path, **lists))
    assert [view.split for view in capture.views] == wanted
    assert len(capture.notes) == len(words)
    assert all(word in note for word, note in zip(words, capture.notes, strict=True))


@pytest.mark.parametrize("wrong", ["images/a.png", [1], {"a": 1}])
def test_a_list_that_is_none_is_refused(tmp_path: Path, wrong: object) -> None:
    with pytest.raises(FileFormatError, match=r"'train_filenames' .* list of texts"):
        open_capture(made.transforms(tmp_path, train_filenames=wrong))
