"""EXIF's orientation turns a photograph only where its camera has the turned size."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps
from view_files import K, store, view_of

from rift_cl.errors import ShapeError
from rift_cl.geometry.camera import Camera
from rift_cl.io import View, read_image, read_view
from rift_cl.io.images.read_picture import read_picture_header

HEIGHT, WIDTH = 48, 64
TYPES = ["jpg", "png", "tif"]


def photograph(folder: Path, suffix: str, orientation: int) -> tuple[Path, np.ndarray]:
    """A corner that is white, so that each of the eight orientations would look different."""
    codes = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    codes[:16, :32] = 255
    path = store(folder / f"a{orientation}.{suffix}", codes, "uint8", Orientation=orientation)
    assert read_picture_header(path).orientation == orientation
    return path, codes / 255


@pytest.mark.parametrize("suffix", TYPES)
@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_rows_and_columns_are_those_of_the_file(
    tmp_path: Path, suffix: str, orientation: int
) -> None:
    path, codes = photograph(tmp_path, suffix, orientation)
    np.testing.assert_allclose(read_view(view_of(path)), codes, atol=0.02)
    np.testing.assert_allclose(read_image(path), codes, atol=0.02)


@pytest.mark.parametrize("orientation", range(2, 9))
def test_a_view_that_is_upright_sees_a_square_as_pillow_turns_it(
    tmp_path: Path, orientation: int
) -> None:
    codes = np.zeros((WIDTH, WIDTH, 3), np.uint8)
    codes[:16, :32] = 255
    path = store(tmp_path / "a.png", codes, "uint8", Orientation=orientation)
    mask = store(tmp_path / "mask.png", codes[..., :1], "uint8")
    camera = Camera((WIDTH, WIDTH), K, np.eye(4))
    with Image.open(path) as stored:
        expected = np.asarray(ImageOps.exif_transpose(stored)) / 255
    assert not np.array_equal(expected, codes / 255)
    shown = read_view(View("a", camera, path, mask, None, upright=True))
    np.testing.assert_array_equal(shown, expected[..., [0, 1, 2, 0]])
    np.testing.assert_array_equal(read_view(View("a", camera, path, None, None)), codes / 255)


def test_a_view_that_is_upright_has_no_camera_of_the_stored_size(tmp_path: Path) -> None:
    path, _ = photograph(tmp_path, "png", 6)
    with pytest.raises(ShapeError, match="is 64 x 48"):
        read_view(View("a", Camera((HEIGHT, WIDTH), K, np.eye(4)), path, None, None, upright=True))


@pytest.mark.parametrize("suffix", TYPES)
@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_a_camera_of_the_turned_size_sees_the_turned_photograph(
    tmp_path: Path, suffix: str, orientation: int
) -> None:
    """Pillow turns the same file for comparison."""
    path, _ = photograph(tmp_path, suffix, orientation)
    turned = View("a", Camera((WIDTH, HEIGHT), K, np.eye(4)), path, None, None)
    with Image.open(path) as stored:
        expected = np.asarray(ImageOps.exif_transpose(stored)) / 255
    np.testing.assert_allclose(read_view(turned), expected, atol=0.02)


def test_a_mask_is_turned_with_its_photograph_if_it_is_stored_alike(tmp_path: Path) -> None:
    path, codes = photograph(tmp_path, "jpg", 6)
    stored = store(tmp_path / "stored.png", 255 * (codes[..., :1] > 0.5).astype(np.uint8), "uint8")
    shown = np.ascontiguousarray(np.rot90(codes, -1)[..., :1] > 0.5)
    turned = store(tmp_path / "turned.png", 255 * shown.astype(np.uint8), "uint8")
    for mask in (stored, turned):
        view = View("a", Camera((WIDTH, HEIGHT), K, np.eye(4)), path, mask, None)
        np.testing.assert_array_equal(read_view(view)[..., 3], shown[..., 0])


def test_another_size_is_refused_whatever_exif_says(tmp_path: Path) -> None:
    for orientation in (1, 6):
        path, _ = photograph(tmp_path, "jpg", orientation)
        size = (WIDTH, HEIGHT) if orientation == 1 else (WIDTH, HEIGHT + 1)
        with pytest.raises(ShapeError, match="is 64 x 48"):
            read_view(View("a", Camera(size, K, np.eye(4)), path, None, None))


COLMAP = """
import pathlib, sqlite3, sys, pycolmap
folder = pathlib.Path("{folder}")
names = sorted(path.name for path in folder.iterdir())
database = folder / "database.db"
database.touch()
pycolmap.import_images(str(database), str(folder), pycolmap.CameraMode.PER_IMAGE, names)
found = sqlite3.connect(database).execute("select width, height from cameras").fetchall()
assert found == [({width}, {height})] * len(names), found
# Before pycolmap 4 pixels could be seen through features alone.
if hasattr(pycolmap, "Bitmap") and hasattr(pycolmap.Bitmap, "width"):
    for name in names:
        pixels = pycolmap.Bitmap.read(str(folder / name), True).to_array()
        assert pixels[:16, :32].min() > 240 and pixels[20:].max() < 15, name
"""


def test_colmap_turns_nothing_either(tmp_path: Path, python: Callable) -> None:
    if find_spec("pycolmap") is None:
        pytest.skip("COLMAP's Python package is not installed")
    for suffix in TYPES:
        for orientation in (1, 3, 6, 8):
            photograph(tmp_path, suffix, orientation)
    code = COLMAP.format(folder=tmp_path.as_posix(), width=WIDTH, height=HEIGHT)
    done = python(code)
    assert done.returncode == 0, done.stderr
