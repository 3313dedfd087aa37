"""The pixels of a view belong to its camera: laws of light, averages, alpha and masks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from view_files import HEIGHT, WIDTH, K, display, linear, store, view_of

from rift_cl.geometry.camera import Camera
from rift_cl.io import camera_at, read_image, read_known_view, read_view, write_png

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_codes_come_back_as_they_are(tmp_path: Path, channels: int) -> None:
    codes = RANDOM.integers(0, 256, (HEIGHT, WIDTH, channels), dtype=np.uint8)
    write_png(tmp_path / "a.png", codes)
    image = read_view(view_of(tmp_path / "a.png"))
    assert image.dtype == np.float32 and image.flags.c_contiguous
    expected = codes if channels > 1 else np.repeat(codes, 3, axis=2)
    np.testing.assert_allclose(image, expected / 255, atol=1e-7)


def test_linear_light_is_that_of_srgb(tmp_path: Path) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    write_png(tmp_path / "a.png", codes)
    image = read_view(view_of(tmp_path / "a.png"), light="linear")
    np.testing.assert_allclose(image, linear(codes / 255), rtol=1e-5)


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".tif"])
def test_real_numbers_count_as_linear(tmp_path: Path, suffix: str) -> None:
    pixels = np.full((HEIGHT, WIDTH, 3), 0.25, np.float32)
    pixels[0, 0] = 3.5
    view = view_of(store(tmp_path / f"a{suffix}", pixels, "float"))
    np.testing.assert_allclose(read_view(view, light="linear"), pixels, rtol=0.01)
    np.testing.assert_allclose(read_view(view), display(pixels), rtol=0.01)


@pytest.mark.parametrize("downscale", [1, 2, 3, 7, 60])
def test_a_smaller_image_is_seen_by_the_smaller_camera(tmp_path: Path, downscale: int) -> None:
    """Light that is linear in the ray is, averaged, that of the ray through the block's middle."""

    def ramp(camera: Camera) -> np.ndarray:
        fx, fy, cx, cy = camera.intrinsics
        x = (np.arange(camera.width) + 0.5 - cx) / fx
        y = (np.arange(camera.height) + 0.5 - cy) / fy
        return np.stack(np.broadcast_arrays(0.5 + x / 2, 0.5 + y[:, None], 0.3 + 0.1 * x), axis=-1)

    full = Camera((HEIGHT, WIDTH), K, np.eye(4))
    path = store(tmp_path / "a.exr", ramp(full).astype(np.float32), "float")
    view = view_of(path)
    camera = camera_at(view, downscale)
    image = read_view(view, downscale=downscale, light="linear")
    assert image.shape == (*camera.size, 3)
    assert camera.size == (HEIGHT // downscale, WIDTH // downscale)
    np.testing.assert_allclose(image, ramp(camera), atol=2e-6)


def test_averages_are_taken_in_linear_light(tmp_path: Path) -> None:
    codes = RANDOM.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", codes)
    expected = linear(codes / 255).reshape(HEIGHT // 4, 4, WIDTH // 4, 4, 3).mean((1, 3))
    view = view_of(tmp_path / "a.png")
    np.testing.assert_allclose(read_view(view, downscale=4, light="linear"), expected, atol=1e-6)
    np.testing.assert_allclose(read_view(view, downscale=4), display(expected), atol=1e-6)


def test_what_is_transparent_gives_no_colour(tmp_path: Path) -> None:
    """A block of red, half of it covered, beside green that is not there."""
    codes = np.zeros((2, 2, 4), np.uint8)
    codes[...] = [255, 0, 0, 255]
    codes[:, 1] = [0, 255, 0, 0]
    write_png(tmp_path / "a.png", codes)
    image = read_view(view_of(tmp_path / "a.png"), downscale=2)
    np.testing.assert_allclose(image, [[[1, 0, 0, 0.5]]], atol=1e-6)
    codes[..., 3] = 0
    write_png(tmp_path / "a.png", codes)
    np.testing.assert_array_equal(read_view(view_of(tmp_path / "a.png"), downscale=2), [[[0] * 4]])


@pytest.mark.parametrize(
    ("name", "kind", "associated", "attributes"),
    [
        ("a.exr", "float", True, {}),
        ("a.tif", "uint8", True, {}),
        ("a.tif", "uint16", False, {"oiio:UnassociatedAlpha": 1}),
        ("a.png", "uint8", False, {"oiio:UnassociatedAlpha": 1}),
    ],
)
def test_alpha_is_straight_whatever_the_file_holds(
    tmp_path: Path, name: str, kind: str, associated: bool, attributes: dict[str, int]
) -> None:
    pixels = np.zeros((2, 2, 4), np.float32)
    pixels[...] = [0.5, 0.25, 1.0, 0.5]
    pixels[0, 0, 3] = 0
    stored = pixels * np.concatenate([pixels[..., 3:]] * 3 + [pixels[..., 3:] ** 0], axis=-1)
    view = view_of(store(tmp_path / name, stored if associated else pixels, kind, **attributes))
    image = read_view(view, light="linear" if name == "a.exr" else "display")
    covered = pixels[..., 3] > 0
    np.testing.assert_allclose(image[covered], pixels[covered], atol=0.01)
    np.testing.assert_array_equal(image[..., 3] == 0, ~covered)


def test_grey_with_alpha(tmp_path: Path) -> None:
    codes = RANDOM.integers(0, 256, (4, 4, 2)).astype(np.uint8)
    spec = OpenImageIO.ImageSpec(4, 4, 2, "uint8")
    spec.channelnames, spec.alpha_channel = ("Y", "A"), 1
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = OpenImageIO.ImageOutput.create("png")
    path = tmp_path / "a.png"
    assert output.open(str(path), spec) and output.write_image(codes) and output.close()
    image = read_view(view_of(path))
    np.testing.assert_allclose(image, codes[..., [0, 0, 0, 1]] / 255, atol=1e-7)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_mask_is_multiplied_into_alpha(tmp_path: Path, channels: int) -> None:
    codes = RANDOM.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
    mask = RANDOM.integers(0, 256, (HEIGHT, WIDTH, 1), dtype=np.uint8)
    write_png(tmp_path / "mask.png", mask if channels == 1 else mask.repeat(channels, axis=2))
    cover = (mask / 255) ** (2 if channels == 4 else 1)
    for count in (3, 4):
        write_png(tmp_path / "a.png", codes[..., :count])
        image = read_view(view_of(tmp_path / "a.png", tmp_path / "mask.png"))
        np.testing.assert_allclose(image[..., :3], codes[..., :3] / 255, atol=1e-6)
        alpha = codes[..., 3:] / 255 if count == 4 else 1
        np.testing.assert_allclose(image[..., 3:], cover * alpha, atol=1e-6)


@pytest.mark.parametrize("downscale", [1, 4])
def test_what_is_masked_out_is_told_from_what_is_transparent(
    tmp_path: Path, downscale: int
) -> None:
    """Alpha and colours are means of what the mask leaves; their product is that of read_view."""
    light = RANDOM.uniform(0, 1, (HEIGHT, WIDTH, 4)).astype(np.float32)
    mask = RANDOM.integers(0, 256, (HEIGHT, WIDTH, 1), dtype=np.uint8)
    light[:8, :8, 3], mask[:8, 8:16] = 0, 0
    write_png(tmp_path / "mask.png", mask)
    path = store(tmp_path / "a.tif", light, "float", **{"oiio:UnassociatedAlpha": 1})
    view = view_of(path, tmp_path / "mask.png")
    image, known = read_known_view(view, downscale=downscale, light="linear")

    def mean(values: np.ndarray) -> np.ndarray:
        blocks = (HEIGHT // downscale, downscale, WIDTH // downscale, downscale, -1)
        return values.reshape(blocks).mean((1, 3))

    share, alpha = mask / 255, light[..., 3:]
    np.testing.assert_allclose(known, mean(share)[..., 0], atol=1e-6)
    seen, shown = mean(share) > 0, mean(share * alpha) > 0
    wanted = mean(share * alpha)[seen] / mean(share)[seen]
    np.testing.assert_allclose(image[seen[..., 0]][:, 3], wanted, atol=1e-5)
    wanted = mean(share * alpha * light[..., :3]) / np.maximum(mean(share * alpha), 1e-9)
    some = shown[..., 0]
    np.testing.assert_allclose(image[some][:, :3], wanted[some], atol=1e-5)
    both = read_view(view, downscale=downscale, light="linear")
    np.testing.assert_allclose(both[..., 3], mean(share * alpha)[..., 0], atol=1e-6)
    np.testing.assert_array_equal(both[some][:, :3], image[some][:, :3])
    corner = 8 // downscale
    assert not image[:corner, :corner, 3].any() and known[:corner, :corner].any()
    assert not known[:corner, corner : 2 * corner].any()


def test_all_of_a_photograph_without_mask_and_lens_is_known(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", RANDOM.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8))
    view = view_of(tmp_path / "a.png")
    image, known = read_known_view(view)
    assert known is None
    np.testing.assert_array_equal(image, read_view(view))


@pytest.mark.parametrize("color", [0, 90, 255])
def test_alpha_is_the_mask_where_it_varies_and_colours_do_not(tmp_path: Path, color: int) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    mask = np.full((HEIGHT, WIDTH, 4), color, np.uint8)
    mask[..., 3] = RANDOM.integers(0, 256, (HEIGHT, WIDTH))
    write_png(tmp_path / "mask.png", mask)
    image = read_view(view_of(tmp_path / "a.png", tmp_path / "mask.png"))
    np.testing.assert_allclose(image[..., 3], mask[..., 3] / 255, atol=1e-6)


def test_a_lossy_mask_is_black_or_white(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    counted = np.zeros((HEIGHT, WIDTH), bool)
    counted[13:41, 22:57] = True
    codes = np.where(counted, 255, 0).astype(np.uint8)[..., None]
    path = store(tmp_path / "mask.jpg", codes, "uint8", Compression="jpeg:60")
    assert np.unique(read_image(path)).size > 2
    image = read_view(view_of(tmp_path / "a.png", path))
    np.testing.assert_array_equal(image[..., 3], counted)


@pytest.mark.parametrize("light", ["display", "linear"])
@pytest.mark.parametrize("kind", ["uint8", "uint16"])
def test_a_png_of_gamma_1_holds_linear_light(tmp_path: Path, kind: str, light: str) -> None:
    scene = RANDOM.uniform(0.05, 1, (HEIGHT, WIDTH, 3))
    stored = scene.astype(np.float32)
    view = view_of(store(tmp_path / "a.png", stored, kind, **{"oiio:ColorSpace": "linear"}))
    error = 0.6 / 255 if kind == "uint8" else 1e-5
    wanted = scene if light == "linear" else display(scene)
    # The curve is steeper than 1, up to 3 from this light on.
    np.testing.assert_allclose(read_view(view, light=light), wanted, atol=3 * error)


@pytest.mark.parametrize("light", ["display", "linear"])
@pytest.mark.parametrize("downscale", [1, 4])
@pytest.mark.parametrize(
    ("name", "kind", "error"),
    [
        ("a.png", "uint8", 0.6 / 255),
        ("a.tif", "uint8", 0.6 / 255),
        ("a.png", "uint16", 1e-5),
        ("a.tif", "uint16", 1e-5),
        ("a.tif", "float", 1e-6),
        ("a.exr", "half", 1e-3),
        ("a.exr", "float", 1e-6),
    ],
)
def test_either_light_from_every_depth(
    tmp_path: Path, name: str, kind: str, error: float, downscale: int, light: str
) -> None:
    """One scene: integers hold its display codes, real numbers its light; both are asked for."""
    scene = RANDOM.uniform(0.05, 1, (HEIGHT, WIDTH, 3))
    stored = scene if kind in ("half", "float") else display(scene)
    view = view_of(store(tmp_path / name, stored.astype(np.float32), kind))
    blocks = (HEIGHT // downscale, downscale, WIDTH // downscale, downscale, 3)
    expected = scene.reshape(blocks).mean((1, 3))
    image = read_view(view, downscale=downscale, light=light)
    # The curve is steeper than 1, up to 2.3 in linear light.
    wanted = expected if light == "linear" else display(expected)
    np.testing.assert_allclose(image, wanted, atol=2.5 * error)
