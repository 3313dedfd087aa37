"""Pictures that do not fit their view: refused by their headers, or by one named error."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from view_files import HEIGHT, WIDTH, K, store, view_of

from rift_cl.errors import (
    FileFormatError,
    InputError,
    NonFiniteError,
    ResourceLimitError,
    ShapeError,
)
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import Lens
from rift_cl.io import View, camera_at, read_view, write_png


@pytest.mark.full
def test_budget(tmp_path: Path) -> None:
    """Nothing is decoded that does not fit, and what fits takes no more than was said."""
    size = (600, 800)
    write_png(tmp_path / "a.png", np.full((*size, 3), 90, np.uint8))
    write_png(tmp_path / "cut.png", np.full((*size, 4), 90, np.uint8))
    write_png(tmp_path / "m.png", np.full(size, 255, np.uint8))
    lens = Lens("OPENCV", (-0.2, 0.05, 0.002, -0.003), K)
    for view in (
        view_of(tmp_path / "a.png"),
        view_of(tmp_path / "a.png", tmp_path / "m.png"),
        view_of(tmp_path / "a.png", tmp_path / "m.png", lens),
        view_of(tmp_path / "cut.png", tmp_path / "m.png"),
        view_of(tmp_path / "cut.png", None, lens),
        view_of(tmp_path / "cut.png", tmp_path / "m.png", lens),
    ):
        numbers = (
            7 + (view.image.name == "cut.png") + (3 if view.mask else 0) + (8 if view.lens else 0)
        )
        need = 4 * numbers * size[0] * size[1]
        with pytest.raises(ResourceLimitError, match=r"\.png: .*claims"):
            read_view(view, budget=need - 1)
        read_view(view, downscale=2, budget=need)
        tracemalloc.start()
        read_view(view, downscale=2, light="linear", budget=need)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        # Blocks of coordinates come on top, a few bytes for each pixel that is held at once.
        assert peak < need + (8 << 20)


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((72, 96), r"--downscale 2\).* by 0\.5$"),
        ((71, 96), r"--downscale 2\).* by 0\.49"),
        ((288, 384), r"same shape: multiply .* by 2$"),
        ((72, 192), "crop"),
    ],
)
def test_photographs_of_another_size_than_the_camera_s(
    tmp_path: Path, size: tuple[int, int], words: str
) -> None:
    """Many captures come with photographs made smaller, under the intrinsics of large ones."""
    write_png(tmp_path / "a.png", np.zeros((*size, 3), np.uint8))
    view = View("a", Camera((144, 192), K, np.eye(4)), tmp_path / "a.png", None, None)
    with pytest.raises(ShapeError, match=words):
        read_view(view)


def test_a_picture_that_claims_more_than_there_is(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((4, 4, 3), np.uint8))
    view = View("a", Camera((1 << 24, 1 << 24), K, np.eye(4)), tmp_path / "a.png", None, None)
    with pytest.raises(ShapeError, match="4 x 4"):
        read_view(view)


@pytest.mark.parametrize("downscale", [0, -1, 1.5, 61, "2", None, np.nan])
def test_factors_that_make_no_sense(tmp_path: Path, downscale: object) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    view = view_of(tmp_path / "a.png")
    for use in (camera_at, lambda view, factor: read_view(view, downscale=factor)):
        with pytest.raises(InputError, match=r"from 1 to 60.* view 'a'"):
            use(view, downscale)
    with pytest.raises(InputError, match="'display' or 'linear'"):
        read_view(view, light="gamma")


def test_pictures_that_do_not_fit(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    write_png(tmp_path / "m.png", np.zeros((HEIGHT, WIDTH - 1), np.uint8))
    camera = Camera((HEIGHT, WIDTH), K, np.eye(4))
    wrong = View("x", Camera((HEIGHT, WIDTH + 1), K, np.eye(4)), tmp_path / "a.png", None, None)
    sizes = r"80 x 60 \(width x height\).*view 'x' says 81 x 60"
    with pytest.raises(ShapeError, match=r"a\.png: is " + sizes):
        read_view(wrong)
    with pytest.raises(ShapeError, match=r"m\.png: is 79 x 60 .* says 80 x 60"):
        read_view(View("x", camera, tmp_path / "a.png", tmp_path / "m.png", None))
    with pytest.raises(InputError, match=r"gone\.png"):
        read_view(View("x", camera, tmp_path / "gone.png", None, None))
    path = store(tmp_path / "five.exr", np.zeros((HEIGHT, WIDTH, 5), np.float32), "float")
    with pytest.raises(FileFormatError, match=r"five\.exr:.*5 channels"):
        read_view(View("x", camera, path, None, None))


def test_pictures_that_are_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, np.random.default_rng(5).random((HEIGHT, WIDTH, 3)))
    view = view_of(path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FileFormatError, match=r"a\.png"):
        read_view(view)
    pixels = np.ones((HEIGHT, WIDTH, 3), np.float32)
    pixels[3, 4, 1] = np.nan
    with pytest.raises(NonFiniteError, match=r"b\.exr: .*image.*NaN"):
        read_view(view_of(store(tmp_path / "b.exr", pixels, "float")))
    write_png(path, np.zeros((HEIGHT, WIDTH, 3)))
    with pytest.raises(NonFiniteError, match=r"b\.exr: .*mask.*NaN"):
        read_view(view_of(path, tmp_path / "b.exr"))


def test_a_mask_of_zeros_and_ones_is_no_black_one(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    write_png(tmp_path / "m.png", mask)
    view = view_of(tmp_path / "a.png", tmp_path / "m.png")
    assert not read_view(view)[..., 3].any()
    mask[2:] = 1
    write_png(tmp_path / "m.png", mask)
    with pytest.raises(FileFormatError, match=r"m\.png: .*mask"):
        read_view(view)


@pytest.mark.parametrize("label", [(255, 0, 0), (0, 0, 128), (2, 2, 2), (15, 15, 15)])
def test_a_mask_of_labels_is_no_black_one(tmp_path: Path, label: tuple[int, ...]) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    mask = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    mask[2:] = label
    write_png(tmp_path / "m.png", mask)
    view = view_of(tmp_path / "a.png", tmp_path / "m.png")
    with pytest.raises(FileFormatError, match=r"m\.png: .*mask"):
        read_view(view)
    mask[0] = 255  # where it is white, it tells what counts
    write_png(tmp_path / "m.png", mask)
    assert (read_view(view)[0, :, 3] == 1).all()


def test_a_mask_may_be_dark_where_it_is_soft(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    codes = np.arange(HEIGHT * WIDTH, dtype=np.uint8).reshape(HEIGHT, WIDTH) % 120
    write_png(tmp_path / "m.png", codes)
    image = read_view(view_of(tmp_path / "a.png", tmp_path / "m.png"))
    np.testing.assert_allclose(image[..., 3], codes / 255, atol=1e-6)


@pytest.mark.parametrize("alpha", [0, 255])
def test_a_mask_that_tells_nothing_by_colours_or_alpha(tmp_path: Path, alpha: int) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    mask = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    mask[..., 3] = alpha
    write_png(tmp_path / "m.png", mask)
    with pytest.raises(FileFormatError, match=r"m\.png: .*alpha"):
        read_view(view_of(tmp_path / "a.png", tmp_path / "m.png"))
