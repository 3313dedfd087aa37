"""What densification knows of each splat: the twin's numbers, the same at every resolution."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from test_parameters import raw_values

from rift_cl.errors import CheckpointError, InputError
from rift_cl.geometry import Camera
from rift_cl.reference.training import screen_statistics
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.strategy.screen_statistics import ScreenStatistics

pytestmark = pytest.mark.dealt

COUNT, SIZE = 300, (90, 160)


def made_up(device, seed):
    """A frame and gradients of random numbers, on the host and as the renderer gives them."""
    random = np.random.default_rng(seed)
    grad = (1e-3 * random.normal(size=(COUNT, 2))).astype(np.float32)
    screen = random.uniform(0, 200, (COUNT, 8)).astype(np.float32)
    culled = random.integers(0, 2, COUNT).astype(np.uint8)
    projection = SimpleNamespace(screen=device.array(screen), culled=device.array(culled))
    frame = SimpleNamespace(camera=SimpleNamespace(size=SIZE), projection=projection)
    return grad, screen, culled, frame


def given(device, grad):
    by = SimpleNamespace(means2d=device.array(grad), means2d_abs=None)
    return SimpleNamespace(splats=by)


def drawn_frame(device, scale, *, absgrad=False):
    """A few splats, drawn at a resolution, and gradients of a mean over its pixels."""
    raw = raw_values(40, 1)
    raw["means"] *= 0.5
    raw["log_scales"][:] = -1.5
    raw["logits"][:] = 1
    height, width = 40 * scale, 60 * scale
    view = np.eye(4)
    view[2, 3] = 4
    K = [[60 * scale, 0, width / 2], [0, 60 * scale, height / 2], [0, 0, 1]]
    # Without dilation pixels of any size draw the same splats.
    renderer = Renderer(SplatSettings(eps2d=0.0, absgrad=absgrad), device=device)
    splats = Parameters.of(device, raw).drawn
    frame = renderer.forward(splats, Camera((height, width), K, view))
    y, x = (np.mgrid[:height, :width] + 0.5) / scale
    pattern = np.stack([np.sin(x / 7), np.cos(y / 5), np.sin((x + y) / 9)], axis=2)
    grad = device.array((pattern / pattern.size).astype(np.float32))
    return frame, renderer.backward(frame, grad)


def test_frames_add_up_to_the_twins_numbers(device):
    statistics = ScreenStatistics(device, COUNT)
    wanted = np.zeros((COUNT, 3))
    for seed in range(4):
        grad, screen, culled, frame = made_up(device, seed)
        statistics.add(frame, given(device, grad))
        extents = screen[:, 6:].astype(float)
        wanted = screen_statistics(wanted, grad.astype(float), extents, culled == 0, SIZE)
    found = statistics.host()
    np.testing.assert_allclose(found, wanted, rtol=1e-5)
    assert set(np.unique(found[:, 1])) == {0, 1, 2, 3, 4}
    assert not found[found[:, 1] == 0].any()


def test_a_gradient_that_is_no_number_is_not_counted(device):
    statistics = ScreenStatistics(device, COUNT)
    grad, screen, culled, frame = made_up(device, 0)
    culled[:] = 0
    frame.projection.culled = device.array(culled)
    hostile = np.float32([np.nan, np.inf, -np.inf, 1e30])
    grad[:4, 0], grad[4:8, 1] = hostile, hostile
    before = np.zeros((COUNT, 3))
    statistics.add(frame, given(device, grad))
    found = statistics.host()
    assert np.isfinite(found).all()
    assert not found[:8].any() and (found[8:, 1] == 1).all()
    with np.errstate(all="ignore"):
        wanted = screen_statistics(before, grad, screen[:, 6:], culled == 0, SIZE)
    np.testing.assert_allclose(found[8:], wanted[8:], rtol=1e-5)


def test_no_resolution_changes_what_is_gathered(device):
    tables = []
    for scale in (2, 4):
        statistics = ScreenStatistics(device, 40)
        statistics.add(*drawn_frame(device, scale))
        tables.append(statistics.host())
    coarse, fine = tables
    seen = coarse[:, 1] == 1
    assert seen.sum() > 20 and np.array_equal(seen, fine[:, 1] == 1)
    # By pixels the gradient would be half as large, and the radius twice as large.
    assert np.median(fine[seen, 0] / coarse[seen, 0]) == pytest.approx(1, abs=0.03)
    np.testing.assert_allclose(fine[seen, 2], coarse[seen, 2], rtol=1e-4)


def test_it_is_the_gradient_by_a_place_from_minus_one_to_one(device):
    frame, gradients = drawn_frame(device, 2)
    statistics = ScreenStatistics(device, 40)
    statistics.add(frame, gradients)
    statistics.add(frame, gradients)
    by = device.get(gradients.splats.means2d).astype(float)
    extents = device.get(frame.projection.screen)[:, 6:]
    drawn = device.get(frame.projection.culled) == 0
    found = statistics.host()
    # 120 x 80 pixels: a step of one pixel is 1/60 and 1/40 of half the image.
    wanted = 2 * np.hypot(60 * by[:, 0], 40 * by[:, 1]) * drawn
    np.testing.assert_allclose(found[:, 0], wanted, rtol=1e-5)
    np.testing.assert_allclose(found[:, 2], extents.max(axis=1) * drawn / 120, rtol=1e-5)


def test_magnitudes_do_not_cancel(device):
    tables = []
    frame, gradients = drawn_frame(device, 2, absgrad=True)
    for absgrad in (False, True):
        statistics = ScreenStatistics(device, 40, absgrad=absgrad)
        statistics.add(frame, gradients)
        tables.append(statistics.host())
    plain, magnitudes = tables
    seen = plain[:, 1] == 1
    assert (magnitudes[seen, 0] > 0.999 * plain[seen, 0]).all()
    assert magnitudes[:, 0].sum() > 1.2 * plain[:, 0].sum()
    assert np.array_equal(plain[:, 1:], magnitudes[:, 1:])


def test_magnitudes_that_were_not_computed_are_asked_for(device):
    with pytest.raises(InputError, match="absgrad=True"):
        ScreenStatistics(device, 40, absgrad=True).add(*drawn_frame(device, 1))


def test_a_frame_of_other_splats_is_refused(device):
    with pytest.raises(InputError, match=r"40 splats.*41"):
        ScreenStatistics(device, 41).add(*drawn_frame(device, 1))


def test_what_is_restored_goes_on_with_the_same_bits(device):
    straight, first, second = (ScreenStatistics(device, COUNT) for _ in range(3))
    for seed in range(6):
        grad, _, _, frame = made_up(device, seed)
        straight.add(frame, given(device, grad))
        (first if seed < 3 else second).add(frame, given(device, grad))
        if seed == 2:
            second.restore(first.host())
    assert straight.host().tobytes() == second.host().tobytes()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (np.zeros((COUNT, 2), np.float32), "shape"),
        (np.zeros(COUNT, np.float32), "shape"),
        (np.full((COUNT, 3), np.nan, np.float32), "not finite"),
        (np.full((COUNT, 3), -1, np.float32), "below zero"),
    ],
)
def test_a_table_of_something_else_is_not_restored(device, table, words):
    with pytest.raises(CheckpointError, match=words):
        ScreenStatistics(device, COUNT).restore(table)


def test_cleared_is_as_new_for_another_number(device):
    statistics = ScreenStatistics(device, COUNT)
    grad, _, _, frame = made_up(device, 0)
    statistics.add(frame, given(device, grad))
    statistics.clear(7)
    assert len(statistics) == 7 and not statistics.host().any()
