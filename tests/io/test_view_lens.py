"""Photographs without their lens: against the scene itself, and against kornia."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from view_files import HEIGHT, WIDTH, K, store, view_of

from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import Lens
from rift_cl.io import camera_at, read_known_view, read_view, write_png

LENSES = {
    "OPENCV": (-0.2, 0.05, 0.002, -0.003),
    "FULL_OPENCV": (0.2, 0.05, 0.001, 0.002, 0.01, 0.4, 0.02, 0.003),
    "FOV": (0.8,),
    "OPENCV_FISHEYE": (0.04, -0.02, 0.01, -0.002),
    "FISHEYE": (),
    "THIN_PRISM_FISHEYE": (0.03, -0.02, 0.001, 0.002, 0.01, -0.003, 0.002, -0.001),
}


def scene(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Smooth linear light in every direction (x, y, 1)."""
    waves = [np.sin(5 * x) * np.cos(4 * y), np.sin(3 * x + 4 * y), np.cos(6 * x - 2 * y)]
    return 0.5 + 0.4 * np.stack(waves, axis=-1)


def seen_by(camera: Camera) -> np.ndarray:
    """The scene through a pinhole."""
    fx, fy, cx, cy = camera.intrinsics
    x = (np.arange(camera.width) + 0.5 - cx) / fx
    y = (np.arange(camera.height) + 0.5 - cy) / fy
    return scene(*np.broadcast_arrays(x, y[:, None]))


def photograph(lens: Lens) -> np.ndarray:
    """The scene through a lens: every pixel looks for the ray that it is reached by."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    pixels = np.stack([x, y], axis=-1)
    rays = pixels.copy()
    for _ in range(200):
        rays -= np.nan_to_num(0.7 * (lens.distort(rays) - pixels))
    x, y = ((rays - K[:2, 2]) / K[[0, 1], [0, 1]]).transpose(2, 0, 1)
    return scene(x, y).astype(np.float32)


@pytest.mark.parametrize("model", LENSES)
@pytest.mark.parametrize("downscale", [1, 2])
def test_without_its_lens_a_photograph_is_a_pinholes(
    tmp_path: Path, model: str, downscale: int
) -> None:
    lens = Lens(model, LENSES[model], K)
    light = photograph(lens)
    view = view_of(store(tmp_path / "a.exr", light, "float"), lens=lens)
    assert np.abs(light - seen_by(view.camera)).max() > 0.1
    image = read_view(view, downscale=downscale, light="linear")
    reached = image[..., 3] == 1
    assert reached.mean() > 0.6
    error = np.abs(image[..., :3] - seen_by(camera_at(view, downscale)))[reached]
    # The outer half pixel repeats its edge; elsewhere the interpolation is what errs.
    assert np.quantile(error, 0.97) < 0.006 * downscale**2


def test_undistortion_is_that_of_kornia(tmp_path: Path) -> None:
    calibration = pytest.importorskip("kornia.geometry.calibration", reason="kornia is not there")
    import torch

    light = np.random.default_rng(5).random((HEIGHT, WIDTH, 3), dtype=np.float32)
    lens = Lens("OPENCV", LENSES["OPENCV"], K)
    image = read_view(view_of(store(tmp_path / "a.exr", light, "float"), lens=lens), light="linear")
    # There the centre of the first pixel is at 0.
    shifted = K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    expected = calibration.undistort_image(
        torch.from_numpy(light.transpose(2, 0, 1)[None]).double(),
        torch.from_numpy(shifted),
        torch.tensor(lens.coefficients, dtype=torch.float64),
    )
    error = np.abs(image[..., :3] - expected[0].numpy().transpose(1, 2, 0))
    assert error[1:-1, 1:-1].max() < 1e-5
    assert (image[..., 3] == 1).all()


def test_where_the_photograph_does_not_reach_alpha_is_zero(tmp_path: Path) -> None:
    """A pincushion: the pinhole's corners lie outside of the photograph."""
    lens = Lens("SIMPLE_RADIAL", (0.3,), [[70, 0, 40], [0, 70, 30], [0, 0, 1]])
    write_png(tmp_path / "a.png", np.full((HEIGHT, WIDTH, 3), 200, np.uint8))
    image = read_view(view_of(tmp_path / "a.png", lens=lens))
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    square = ((x - 40) ** 2 + (y - 30) ** 2) / 4900
    inside = (np.abs(x - 40) * (1 + 0.3 * square) <= 40) & (
        np.abs(y - 30) * (1 + 0.3 * square) <= 30
    )
    np.testing.assert_array_equal(image[..., 3], inside)
    np.testing.assert_allclose(image[inside][:, :3], 200 / 255, atol=1e-6)
    assert not image[~inside].any() and 0.1 < inside.mean() < 0.9


def test_where_a_photograph_with_alpha_does_not_reach_nothing_is_known(tmp_path: Path) -> None:
    """Its transparent half is known to be empty; beyond its edges nobody knows."""
    lens = Lens("SIMPLE_RADIAL", (0.3,), [[70, 0, 40], [0, 70, 30], [0, 0, 1]])
    codes = np.full((HEIGHT, WIDTH, 4), 200, np.uint8)
    codes[:, : WIDTH // 2, 3] = 0
    write_png(tmp_path / "a.png", codes)
    write_png(tmp_path / "b.png", codes[..., :3])
    image, known = read_known_view(view_of(tmp_path / "a.png", lens=lens))
    plain, reached = read_known_view(view_of(tmp_path / "b.png", lens=lens))
    np.testing.assert_array_equal(known, reached)
    assert 0.1 < known.mean() < 0.9 and plain.shape[2] == 3
    inside = known > 0
    assert not image[:, : WIDTH // 2 - 1, 3].any()
    right = inside & (np.arange(WIDTH) > WIDTH // 2)
    np.testing.assert_allclose(image[right][:, 3], 200 / 255, atol=1e-6)


@pytest.mark.parametrize("downscale", [1, 2])
def test_outside_of_the_circle_of_a_fisheye_nothing_is_known(
    tmp_path: Path, downscale: int
) -> None:
    """An equidistant lens: the pinhole sees the circle's edge at the tangent of its angle."""
    radius, focal = 25.0, 50.0
    codes = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    codes[np.hypot(x - WIDTH / 2, y - HEIGHT / 2) < radius] = 200
    write_png(tmp_path / "a.png", codes)
    middle = [[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]]
    lens = Lens("OPENCV_FISHEYE", (0, 0, 0, 0), middle)
    view = replace(view_of(tmp_path / "a.png", lens=lens), crop_radius=radius)
    image, known = read_known_view(view, downscale=downscale)
    assert known is not None and image.shape[2] == 3
    down, across = (
        (np.arange(count) + 0.5) * downscale - extent / 2
        for count, extent in zip(known.shape, (HEIGHT, WIDTH), strict=True)
    )
    away = np.hypot(across, down[:, None])
    edge = focal * np.tan(radius / focal)
    assert (known[away < edge - 2 * downscale] == 1).all()
    assert not known[away > edge + 2 * downscale].any()
    # The black around the circle is no part of what is known.
    np.testing.assert_allclose(image[known > 0], 200 / 255, atol=1e-6)
    np.testing.assert_array_equal(read_view(view, downscale=downscale)[..., 3], known)


def test_a_mask_leaves_out_more_of_the_circle_of_a_fisheye(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.full((HEIGHT, WIDTH, 3), 200, np.uint8))
    mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
    mask[:, : WIDTH // 2] = 0
    write_png(tmp_path / "mask.png", mask)
    view = replace(view_of(tmp_path / "a.png", tmp_path / "mask.png"), crop_radius=20.0)
    _, known = read_known_view(view)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    circle = np.hypot(x - WIDTH / 2, y - HEIGHT / 2) < 20
    np.testing.assert_array_equal(known, circle & (x > WIDTH / 2))


def test_a_mask_is_taken_through_the_lens_too(tmp_path: Path) -> None:
    lens = Lens("OPENCV", LENSES["OPENCV"], K)
    codes = np.full((HEIGHT, WIDTH, 3), 100, np.uint8)
    codes[:, : WIDTH // 2] = 250
    mask = np.where(np.arange(WIDTH) < WIDTH // 2, 0, 255).astype(np.uint8)
    write_png(tmp_path / "a.png", codes)
    write_png(tmp_path / "m.png", np.broadcast_to(mask, (HEIGHT, WIDTH)))
    image = read_view(view_of(tmp_path / "a.png", tmp_path / "m.png", lens))
    covered = image[..., 3] > 1e-3
    assert 0.3 < covered.mean() < 0.7
    # What the mask hides leaves no trace at its edge.
    np.testing.assert_allclose(image[covered][:, :3], 100 / 255, atol=1e-4)
