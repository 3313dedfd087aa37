"""Paths in a capture that lead out of its folder are refused; honest ones are followed."""

from __future__ import annotations

from pathlib import Path

import capture_files as made
import pytest

from rift_cl.errors import FileFormatError, InputError, PathEscapeError
from rift_cl.io import open_capture

ESCAPES = [
    "../secret.png",
    "images/../../secret.png",
    "images/./../../secret.png",
    "..\\secret.png",
    "images\\..\\..\\secret.png",
    "{outside}/secret.png",
    "//{outside}/secret.png",
    "C:\\secret.png",
    "C:secret.png",
    "c:/secret.png",
    "\\\\server\\share\\secret.png",
    "link.png",
    "link/secret.png",
    "link_to_link.png",
    "link",
    "secret.png\0.png",
    "\0",
    "..",
    "/",
    "",
]


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """A capture beside a secret, with links that lead out of it."""
    folder = tmp_path / "capture"
    made.transforms(folder, ply_file_path=None)
    made.photographs(tmp_path, ["secret.png"])
    made.point_cloud(tmp_path / "secret.ply")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "link_to_link.png").symlink_to("link.png")
    (folder / "link").symlink_to(tmp_path)
    return folder


def hostile(folder: Path, name: str) -> str:
    return name.format(outside=folder.parent)


@pytest.mark.parametrize("name", ESCAPES)
@pytest.mark.parametrize("field", ["file_path", "mask_path"])
def test_frames_that_lead_outside(capture: Path, field: str, name: str) -> None:
    path = made.changed(capture / "transforms.json", 1, **{field: hostile(capture, name)})
    with pytest.raises(PathEscapeError, match=r"frames\[1\] .*(outside the folder|is no path)"):
        open_capture(path)


@pytest.mark.parametrize("name", ["../secret.ply", "link/secret.ply"])
def test_points_that_lie_outside(capture: Path, name: str) -> None:
    with pytest.raises(PathEscapeError, match=r"'ply_file_path'"):
        open_capture(made.transforms(capture, ply_file_path=name))


@pytest.mark.parametrize("name", [name for name in ESCAPES if "\0" not in name])
def test_colmap_images_that_lie_outside(capture: Path, name: str) -> None:
    (capture / "transforms.json").unlink()
    made.colmap_binary(capture / "sparse")
    target = capture / "sparse" / "images.bin"
    # From a folder further down, so that a name needs one step more to get out.
    steps = "../" if name.startswith((".", "link", "images")) else ""
    text = steps + hostile(capture, name)
    target.write_bytes(target.read_bytes().replace(b"b.png", text.encode()))
    with pytest.raises(PathEscapeError, match=r"images\.bin: image .*(outside|is no path)"):
        open_capture(capture)


def test_a_folder_of_images_that_lies_outside(capture: Path) -> None:
    (capture / "transforms.json").unlink()
    made.colmap_text(capture / "sparse")
    (capture / "images").rename(capture.parent / "images")
    (capture / "images").symlink_to(capture.parent / "images")
    with pytest.raises(PathEscapeError, match="outside the folder") as caught:
        open_capture(capture)
    words = f"{capture / 'images'} is a link to {capture.parent / 'images'}, outside"
    assert words in str(caught.value) and "cp -rL" in str(caught.value)


def test_a_photograph_that_is_a_link_is_called_so(capture: Path) -> None:
    """Whoever made it reads what to do; a name that leads out by itself is no link."""
    path = capture / "transforms.json"
    for name, words in (
        ("link_to_link.png", f"{capture / 'link_to_link.png'} is a link to"),
        ("link/secret.png", f"{capture / 'link'} is a link to {capture.parent}, outside"),
        ("../secret.png", "leads to '../secret.png'"),
    ):
        with pytest.raises(PathEscapeError) as caught:
            open_capture(made.changed(path, 1, file_path=name))
        assert words in str(caught.value)


def test_a_mask_that_lies_outside(capture: Path) -> None:
    (capture / "transforms.json").unlink()
    made.colmap_text(capture / "sparse")
    (capture / "masks").symlink_to(capture.parent)
    (capture.parent / "a.png").symlink_to("secret.png")
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_capture(capture)


@pytest.mark.parametrize(
    "name",
    [
        "images/b.png",
        "./images//b.png",
        "images/../images/b.png",
        "images\\b.png",
        "{inside}/images/b.png",
        "inner.png",
        "inner/b.png",
        "images/b",
    ],
)
def test_honest_paths_are_followed(capture: Path, name: str) -> None:
    (capture / "inner.png").symlink_to("images/b.png")
    (capture / "inner").symlink_to("images")
    path = made.changed(
        capture / "transforms.json", 1, file_path=name.format(inside=capture.as_posix())
    )
    view = open_capture(path).views[1]
    assert view.image.read_bytes() == (capture / "images" / "b.png").read_bytes()
    assert not Path(view.name).is_absolute() and ".." not in view.name


def test_a_capture_may_itself_be_reached_by_a_link(capture: Path) -> None:
    (capture.parent / "alias").symlink_to(capture)
    views = open_capture(capture.parent / "alias").views
    assert views[0].image == capture.parent / "alias" / "images" / "a.png"
    assert views[0].name == "images/a.png"
    made.changed(capture / "transforms.json", 0, file_path=str(capture / "images" / "a.png"))
    assert open_capture(capture.parent / "alias").views[0].name == "images/a.png"


@pytest.mark.parametrize("name", ["loop.png", "x" * 300, "x/" * 3000, "\ud800", "images"])
def test_names_that_no_file_can_have(capture: Path, name: str) -> None:
    (capture / "loop.png").symlink_to("loop.png")
    path = made.changed(capture / "transforms.json", 1, file_path=name)
    with pytest.raises((FileFormatError, InputError), match=r"frames\[1\]") as caught:
        open_capture(path)
    assert len(str(caught.value)) < 600
