"""What a fit sees of photographs: backgrounds, masks, light, the same codes from every store."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from view_files import linear, store, view_of

import rift_cl as rift
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.fit_photos.scores import scores_of
from rift_cl.commands.view.photographs import photographs_in_work, seen_by
from rift_cl.errors import FileFormatError
from rift_cl.geometry.lens_distortion import Lens

GREY = 128


def codes(channels=3, seed=0):
    """A grey picture with coloured noise in its middle."""
    picture = np.full((24, 30, channels), GREY, np.uint8)
    picture[8:16, 10:20] = np.random.default_rng(seed).integers(0, 256, (8, 10, channels))
    return picture


def pictures(views, **more):
    return CapturePictures(rift.default_device(), views, **more)


def opened(folder, picture, kind="uint8", mask=None, name="a.png", lens=None):
    path = store(folder / name, picture, kind, **{"oiio:UnassociatedAlpha": 1})
    where = None if mask is None else store(folder / "mask.png", mask, "uint8")
    return view_of(path, where, lens)


def linear_inverse(light):
    """Display light of linear light, by the curve of sRGB."""
    curved = 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055
    return np.where(light > 0.0031308, curved, 12.92 * light)


def cut_out():
    """Noise whose alpha is 255 in its middle and 0 elsewhere."""
    picture = codes(4)
    picture[..., 3] = 0
    picture[8:16, 10:20, 3] = 255
    return picture


def left_mask(columns):
    """Black in so many columns at the left."""
    mask = np.full((24, 30, 1), 255, np.uint8)
    mask[:, :columns] = 0
    return mask


def test_eight_bits_are_kept_exactly_and_sixteen_almost(tmp_path):
    seen = pictures([opened(tmp_path, codes())])
    np.testing.assert_array_equal(seen.image(0), np.float32(codes()) / np.float32(255))
    deep = np.random.default_rng(1).integers(0, 65536, (24, 30, 3)).astype(np.uint16)
    fine = pictures([opened(tmp_path, deep, "uint16", name="b.png")])
    np.testing.assert_allclose(fine.image(0), deep / 65535, atol=0.51 / 65535)


def test_what_does_not_fit_into_memory_is_the_same_when_decoded_again(tmp_path, monkeypatch):
    deep = np.random.default_rng(1).uniform(0, 1, (24, 30, 3)).astype(np.float32)
    view = opened(tmp_path, deep, "float", name="a.exr")
    kept = pictures([view])
    monkeypatch.setattr("rift_cl.commands.fit_photos.pictures._SHARE", 0.0)
    streamed = pictures([view])
    assert kept.image(0).tobytes() == streamed.image(0).tobytes()
    assert kept._kept and not streamed._kept


def test_what_is_not_kept_is_read_while_the_step_before_works(tmp_path, monkeypatch):
    """By another thread, once for each step, and what a step sees is the same."""
    views = [opened(tmp_path, codes(seed=seed), name=f"{seed}.png") for seed in range(4)]
    order, mains = [2, 0, 3, 1, 1, 2, 0], []
    read = CapturePictures._read

    def noted(self, number):
        mains.append((number, threading.current_thread() is threading.main_thread()))
        return read(self, number)

    kept = pictures(views)
    monkeypatch.setattr("rift_cl.commands.fit_photos.pictures._SHARE", 0.0)
    streamed = pictures(views)
    streamed.announce(order.__getitem__)
    monkeypatch.setattr(CapturePictures, "_read", noted)
    for step, number in enumerate(order[:-1]):
        streamed.begin(step)
        assert streamed.image(number).tobytes() == kept.image(number).tobytes()
    streamed.image(order[-1])
    assert mains == [(2, True), *((number, False) for number in (0, 3, 1, 2, 0))]


def test_a_photograph_that_cannot_be_read_is_told_at_its_step(tmp_path, monkeypatch):
    views = [opened(tmp_path, codes(seed=seed), name=f"{seed}.png") for seed in range(2)]
    monkeypatch.setattr("rift_cl.commands.fit_photos.pictures._SHARE", 0.0)
    seen = pictures(views)
    seen.announce([0, 1, 0].__getitem__)
    views[1].image.write_bytes(b"no picture")
    seen.begin(0)
    with pytest.raises(FileFormatError):
        seen.begin(1)


def test_photographs_are_kept_within_the_memory_of_a_device_that_shares_the_hosts(tmp_path):
    views = [opened(tmp_path, codes(seed=seed), name=f"{seed}.png") for seed in range(4)]
    device = rift.default_device()
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=6000)
    seen = CapturePictures(small, views)
    assert [seen.keep(number) for number in range(4)] == [True, False, False, False]


def test_a_common_border_is_the_background(tmp_path):
    seen = pictures([opened(tmp_path, codes())])
    np.testing.assert_allclose(seen.behind, GREY / 255, atol=1e-6)
    front = seen.foreground(0)
    assert front[8:16, 10:20].mean() > 0.95 and not front[:8].any()
    noise = np.random.default_rng(0).integers(0, 256, (24, 30, 3)).astype(np.uint8)
    assert pictures([opened(tmp_path, noise, name="b.png")]).foreground(0) is None


def test_a_picture_that_was_cut_out_is_laid_over_a_new_background_every_step(tmp_path):
    picture = cut_out()
    seen, shown = pictures([opened(tmp_path, picture)], seed=5), []
    for step in (3, 4, 3):
        seen.begin(step)
        target, behind = (seen.device.get(a) for a in (seen.target(0), seen.background(0)))
        np.testing.assert_allclose(target[0, 0], behind, atol=1e-6)
        np.testing.assert_allclose(target[10, 12], picture[10, 12, :3] / 255, atol=1e-6)
        shown.append(behind)
    assert (shown[0] == shown[2]).all() and (shown[0] != shown[1]).any()
    assert seen.weights(0) is None and seen.counted(0) is None
    assert seen.foreground(0).sum() == 80


def test_what_a_mask_hides_does_not_count_and_stays_no_hole(tmp_path):
    seen = pictures([opened(tmp_path, codes(), mask=left_mask(6))])
    seen.begin(0)
    weights = seen.device.get(seen.weights(0))
    assert not weights[:, :6].any() and (weights[:, 6:] == 1).all()
    # The background is that of the pictures, not one drawn by chance.
    np.testing.assert_allclose(seen.device.get(seen.background(0)), seen.behind)
    np.testing.assert_array_equal(seen.counted(0), weights > 0)
    assert not seen.foreground(0)[:, :6].any()


def test_what_a_mask_hides_of_a_picture_that_was_cut_out_is_unknown_and_not_empty(tmp_path):
    """Its transparent pixels are fitted as empty; masked-out ones are neither fitted nor scored."""
    picture = cut_out()
    seen = pictures([opened(tmp_path, picture, mask=left_mask(15))], seed=5)
    assert seen.any_cut_out()
    seen.begin(3)
    weights = seen.device.get(seen.weights(0))
    assert not weights[:, :15].any() and (weights[:, 15:] == 1).all()
    np.testing.assert_array_equal(seen.counted(0), weights > 0)
    wanted = picture[..., 3] > 0
    wanted[:, :15] = False
    np.testing.assert_array_equal(seen.foreground(0), wanted)
    target, behind = (seen.device.get(a) for a in (seen.target(0), seen.background(0)))
    np.testing.assert_allclose(target[0, 20], behind, atol=1e-6)
    np.testing.assert_allclose(target[10, 16], picture[10, 16, :3] / 255, atol=1e-6)
    # The viewer lays nothing over what the mask hides.
    (shown,) = photographs_in_work(seen)
    np.testing.assert_array_equal(shown.read()[..., 3], weights)
    assert not seen_by(shown, shown.camera)[1][:, :14].any()


def test_a_pixel_that_is_known_in_part_has_the_colour_of_that_part(tmp_path):
    """Half of its block is masked out: it weighs half, and nothing of a background is in it."""
    solid, mask = np.full((24, 30, 4), 255, np.uint8), left_mask(7)
    solid[..., :3], solid[:2, :, 3] = 200, 0
    seen = pictures([opened(tmp_path, solid, mask=mask)], downscale=2)
    assert seen.device.get(seen.weights(0))[5, 3] == pytest.approx(0.5, abs=1e-4)
    behind = np.array([0.1, 0.2, 0.3], np.float32)
    np.testing.assert_allclose(seen.over(0, behind)[5, 3:], 200 / 255, atol=1e-4)
    np.testing.assert_allclose(seen.over(0, behind)[0, 4:], behind[None].repeat(11, 0), atol=1e-4)
    np.testing.assert_allclose(seen.over(0, behind)[5, :3], behind[None].repeat(3, 0), atol=1e-4)


@pytest.mark.parametrize("level", [255, 254])
def test_constant_alpha_under_a_soft_mask_cuts_out_nothing(tmp_path, level):
    picture, mask = codes(4), left_mask(6)
    picture[..., 3] = level
    mask[:, 6:12] = np.random.default_rng(2).integers(0, 256, (24, 6, 1))
    lens = Lens("SIMPLE_RADIAL", (0.05,), [[70, 0, 15], [0, 70, 12], [0, 0, 1]])
    seen = pictures([opened(tmp_path, picture, mask=mask, lens=lens)], downscale=2)
    assert not seen.any_cut_out() and seen.image(0).shape[2] == 3
    np.testing.assert_allclose(seen.behind, GREY / 255, atol=1e-3)


def test_the_border_of_a_pincushion_is_where_its_photograph_ends(tmp_path):
    """All rows and columns at the edges of its undistorted picture are unknown."""
    lens = Lens("SIMPLE_RADIAL", (3.0,), [[70, 0, 15], [0, 70, 12], [0, 0, 1]])
    seen = pictures([opened(tmp_path, codes(), lens=lens)])
    counted = seen.counted(0)
    assert not counted[[0, -1]].any() and not counted[:, [0, -1]].any() and counted.mean() > 0.5
    np.testing.assert_allclose(seen.behind, GREY / 255, atol=1e-6)
    assert 0.1 < seen.foreground(0).mean() < 0.4
    # So it is beneath a mask, whose own edge runs through what is photographed.
    masked = pictures([opened(tmp_path, codes(), mask=left_mask(15), lens=lens)])
    np.testing.assert_allclose(masked.behind, GREY / 255, atol=1e-6)
    assert not masked.foreground(0)[:, :14].any()


def test_the_border_of_a_fisheye_is_its_circle_and_not_the_black_around_it(tmp_path):
    picture = codes()
    y, x = np.mgrid[:24, :30]
    picture[np.hypot(x - 14.5, y - 11.5) >= 11] = 0
    lens = Lens("OPENCV_FISHEYE", (0, 0, 0, 0), [[70, 0, 15], [0, 70, 12], [0, 0, 1]])
    view = replace(opened(tmp_path, picture, lens=lens), crop_radius=11.0)
    for seen in (pictures([view]), pictures([view], downscale=2)):
        np.testing.assert_allclose(seen.behind, GREY / 255, atol=1e-3)
        assert 0.5 < seen.counted(0).mean() < 0.6
    # So it is beneath a mask, whose own edge runs through what is photographed.
    store(tmp_path / "mask.png", left_mask(15), "uint8")
    masked = pictures([replace(view, mask=tmp_path / "mask.png")])
    np.testing.assert_allclose(masked.behind, GREY / 255, atol=1e-6)


def test_the_edge_of_a_mask_is_no_border(tmp_path):
    """A mask of the object alone leaves its silhouette, whose colour is no background."""
    picture, mask = np.full((24, 30, 3), 90, np.uint8), np.zeros((24, 30, 1), np.uint8)
    mask[8:16, 10:20] = 255
    seen = pictures([opened(tmp_path, picture, mask=mask)])
    assert seen.border is None and not seen.behind.any()


def test_a_colour_under_transparent_pixels_is_no_background(tmp_path):
    picture = cut_out()
    picture[picture[..., 3] == 0, :3] = [255, 0, 255]
    seen = pictures([opened(tmp_path, picture)])
    assert not seen.behind.any() and seen.border is None
    assert seen.foreground(0).sum() == 80


def test_pixels_that_do_not_count_change_no_score():
    random = np.random.default_rng(0)
    truth = random.uniform(0, 1, (20, 30, 3)).astype(np.float32)
    image = np.clip(truth + 0.05 * random.normal(size=truth.shape), 0, 1).astype(np.float32)
    counted = np.ones((20, 30), bool)
    counted[:, :9] = False
    found = []
    for garbage in (0.0, 1.0):
        image[:, :9] = garbage
        found.append(scores_of(image, truth, (counted, None), "fit"))
    assert found[0] == found[1]
    right = scores_of(image[:, 9:], truth[:, 9:], (None, None), "fit")
    assert found[0]["fit_psnr"] == pytest.approx(right["fit_psnr"], abs=1e-9)


@pytest.mark.parametrize("share", [0.6, 0.1])
def test_every_score_is_a_mean_over_the_pixels_that_count(share):
    """The same noise everywhere: a smaller mask makes no score better."""
    random = np.random.default_rng(0)
    truth = random.uniform(0, 1, (40, 60, 3)).astype(np.float32)
    image = np.clip(truth + 0.2 * random.normal(size=truth.shape), 0, 1).astype(np.float32)
    counted = np.zeros((40, 60), bool)
    counted[:, : round(60 * share)] = True
    asked = []

    def more(image, truth, mask):
        asked.append(mask)

    found = scores_of(image, truth, (counted, None), "fit", {"lpips": more})
    assert asked[0] is counted and set(found) == {"fit_psnr", "fit_ssim"}
    hidden = (np.where(counted[..., None], array, 0.5) for array in (image, truth))
    again = scores_of(*hidden, (counted, None), "fit")
    assert again == {name: pytest.approx(value, abs=1e-12) for name, value in found.items()}
    whole = scores_of(image, truth, (None, None), "fit")
    assert found["fit_ssim"] == pytest.approx(whole["fit_ssim"], abs=0.1)


@pytest.mark.parametrize("light", ["display", "linear"])
def test_what_is_brighter_than_white_is_fitted_as_it_is_and_scored_as_it_is_shown(tmp_path, light):
    bright = np.full((24, 30, 3), 0.25, np.float32)
    bright[4:, :7], bright[4:, 7:9] = 3.5, -0.1
    seen = pictures([opened(tmp_path, bright, "float", name="a.exr")], light=light)
    wanted = bright if light == "linear" else linear_inverse(bright)
    assert wanted.max() > 1.7 and wanted.min() < -0.05
    for _ in range(2):  # As it was read, and as it was kept.
        np.testing.assert_allclose(seen.image(0), wanted, atol=1e-5)
        seen._last = None
    shown = np.clip(linear_inverse(bright), 0, 1)
    np.testing.assert_allclose(seen.shown(seen.image(0)), shown, atol=1e-5)


def test_linear_light_is_fitted_and_shown_for_a_display(tmp_path):
    view = opened(tmp_path, codes())
    seen = pictures([view], light="linear")
    np.testing.assert_allclose(seen.image(0), linear(codes() / 255), atol=1e-6)
    np.testing.assert_allclose(seen.shown(seen.image(0)), codes() / 255, atol=1e-5)
    bright = np.full((24, 30, 3), 3.5, np.float32)
    over = pictures([opened(tmp_path, bright, "float", name="c.exr")], light="linear")
    assert over.image(0).max() == pytest.approx(3.5)
    assert over.shown(over.image(0)).max() == pytest.approx(1.0)
