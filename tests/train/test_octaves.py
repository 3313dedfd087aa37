"""Images that are halved at first: what a halving leaves out, and when its level is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rift_cl.errors import CheckpointError, SettingError
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at
from rift_cl.reference.training import image_shrink
from rift_cl.train import ImageViews, Parameters, Trainer, TrainSettings, start_splats
from rift_cl.train.loss.coverage_weight import CoverageWeight
from rift_cl.train.octave_settings import OctaveSettings
from rift_cl.train.per_view.octaves import Octaves, octave_powers, shrunk

RANDOM = np.random.default_rng(0)


def camera(height=64, width=64, around=0.0):
    view = look_at((4 * np.cos(around), 4 * np.sin(around), 0.5), (0, 0, 0), (0, 0, 1))
    return Camera((height, width), [[width, 0, width / 2], [0, width, height / 2], [0, 0, 1]], view)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize(("size", "factor"), [((13, 22), 2), ((16, 8), 4), ((9, 7), 3)])
def test_a_smaller_image_is_the_mean_of_what_counts(device, size, factor, weighted):
    image = RANDOM.uniform(size=(*size, 3)).astype(np.float32)
    weights = (RANDOM.uniform(size=size) * (RANDOM.uniform(size=size) > 0.4)).astype(np.float32)
    weights[:factor, :factor] = 0
    sent = device.array(weights) if weighted else None
    found, share = shrunk(device, device.array(image), sent, factor)
    wanted, known = image_shrink(image.astype(float), factor, weights if weighted else None)
    np.testing.assert_allclose(device.get(found), wanted, atol=1e-6)
    assert (share is None) != weighted
    if weighted:
        np.testing.assert_allclose(device.get(share), known, atol=1e-6)


def test_a_smaller_image_is_what_its_camera_sees():
    full = camera(50, 61)
    small = full.shrunk(3)
    assert small.size == (16, 20)
    points = RANDOM.uniform(-0.5, 0.5, (9, 3)) @ full.view[:3, :3].T + full.view[:3, 3]
    places = [(points @ each.K.T)[:, :2] / points[:, 2:] for each in (full, small)]
    np.testing.assert_allclose(places[1], places[0] / 3, rtol=1e-12)


def _views(device, images, weights=None):
    cameras = [camera(*image.shape[:2], around=k) for k, image in enumerate(images)]
    return ImageViews(device, cameras, images, weights=weights)


def test_powers_are_those_of_the_octaves(device):
    """Stripes of one pixel are in the first octave alone, stripes of two in the second."""
    x = np.arange(64)
    stripes = [0.5 + a * (-1.0) ** (x // wide) for a, wide in ((0.3, 1), (0.2, 2))]
    images = [np.broadcast_to(row[None, :, None], (32, 64, 3)) for row in stripes]
    for image, wanted in zip(images, ([0.09, 0, 0], [0, 0.04, 0]), strict=True):
        found = octave_powers(device, _views(device, [image]), 3)
        np.testing.assert_allclose(found, wanted, atol=1e-9)
    both = octave_powers(device, _views(device, images), 3)
    np.testing.assert_allclose(both, [0.045, 0.02, 0], atol=1e-9)
    none = octave_powers(device, _views(device, images[:1], weights=[np.zeros((32, 64))]), 3)
    assert not none.any()


@pytest.mark.parametrize(
    ("size", "count"),
    [((168, 224), 0), ((480, 270), 0), ((672, 896), 3), ((20, 8000), 0), ((2000, 3000), 4)],
)
def test_large_images_are_halved_by_default(size, count):
    assert OctaveSettings().decided([camera(*size)]).count == count
    assert OctaveSettings(1).decided([camera(*size)] if min(size) > 31 else [camera()]).count == 1


def test_images_are_not_halved_to_nothing():
    with pytest.raises(SettingError, match="count is 3, which leaves 8 pixels"):
        OctaveSettings(3).decided([camera(500, 500), camera(64, 90)])


def _octaves(device, count=2, steps=1000, **more):
    image = np.broadcast_to((np.arange(64) % 2)[None, :, None], (64, 64, 3))
    octaves = Octaves(device, _views(device, [image]), OctaveSettings(count, **more), steps)
    octaves.powers = np.array([0.01, 0.04])
    return octaves


def _images(device, octaves, square):
    target = device.zeros((64 >> octaves.level, 64 >> octaves.level, 3))
    return device.array(np.full(target.shape, np.sqrt(square), np.float32)), target, None


def test_a_level_is_left_once_the_residual_is_below_its_octave(device):
    octaves, levels = _octaves(device), []
    for step in range(1, 121):
        square = 0.05 if step <= 40 else 0.02 if step <= 80 else 0.005
        octaves.after_step(step, *_images(device, octaves, square))
        levels.append(octaves.level)
    assert levels[:39] == [2] * 39 and levels[-1] == 0
    # The running mean needs some looks to get down.
    assert levels[59] == 1 and levels[79] == 1
    assert (octaves.ended > [80, 40]).all()


def test_one_easy_view_does_not_end_a_level(device):
    octaves = _octaves(device)
    for step in range(1, 25):
        octaves.after_step(step, *_images(device, octaves, 1e-6))
    assert octaves.level == 2
    octaves.after_step(25, *_images(device, octaves, 1e-6))
    assert octaves.level == 1


def test_levels_end_in_time_where_the_residual_stays_large(device):
    octaves, ended = _octaves(device, steps=100, last=0.4), []
    for step in range(1, 60):
        octaves.after_step(step, *_images(device, octaves, 1.0))
        ended.append(octaves.level)
    assert octaves.ended.tolist() == [40, 20] and ended[18:20] == [2, 1] and ended[-1] == 0


def _trainer(device, **more):
    random = np.random.default_rng(5)
    images = [random.uniform(size=(64, 64, 3)).astype(np.float32) for _ in range(3)]
    weights = [np.ones((64, 64), np.float32)] * 3
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (40, 3))
    splats = Parameters.of(device, start_splats(points))
    settings = TrainSettings(steps=30, splats=40, **more)
    return Trainer(_views(device, images, weights), splats, settings)


@pytest.mark.full
def test_a_fit_that_is_broken_off_on_a_level_goes_on_to_the_same_bits(device):
    whole, first, second = (_trainer(device, octaves=OctaveSettings(2, 0.4)) for _ in range(3))
    second.pictures = first.pictures = whole.pictures
    for _ in range(4):
        first.step()
    assert first.octaves.level == 2
    second.restore(first.state())
    for trainer, steps in ((whole, 20), (second, 16)):
        for _ in range(steps):
            trainer.step()
    assert whole.octaves.level == 0 and whole.octaves.ended.tolist() == [12, 6]
    for name, array in whole.state().items():
        assert array.tobytes() == second.state()[name].tobytes(), name


def test_a_checkpoint_of_other_octaves_is_refused(device):
    one, two, none = (_trainer(device, octaves=OctaveSettings(count)) for count in (1, 2, 0))
    for trainer, other in ((two, one), (none, one), (one, none)):
        with pytest.raises(CheckpointError, match="octaves"):
            trainer.restore(other.state())
    state = two.state()
    with pytest.raises(CheckpointError):
        two.restore({**state, "octaves.level": np.array(7)})


def test_a_trainer_renders_what_it_compares(device, monkeypatch):
    trainer, sizes = _trainer(device, octaves=OctaveSettings(2, 0.4)), []
    forward = trainer.renderer.forward

    def seen(splats, camera, **more):
        sizes.append(camera.size)
        return forward(splats, camera, **more)

    monkeypatch.setattr(trainer.renderer, "forward", seen)
    for _ in range(14):
        trainer.step()
    assert sizes == [(16, 16)] * 6 + [(32, 32)] * 6 + [(64, 64)] * 2


def test_weights_by_coverage_are_those_of_the_larger_image(device):
    cameras = [camera(around=k) for k in range(5)]
    weight = CoverageWeight(cameras, device)
    k = np.fft.fftfreq(16)
    ky, kx = k[:, None], k[None]
    small, full = weight.response(2, 0.5, 4), weight.response(2, 0.5)
    np.testing.assert_array_equal(small(ky, kx), full(ky / 4, kx / 4))
    trainer = _trainer(
        device,
        octaves=OctaveSettings(2, 0.4),
        homogenisation=replace(TrainSettings().homogenisation, exponent=0.5, weight="coverage"),
    )
    assert np.isfinite(device.get(trainer.step())).all()
