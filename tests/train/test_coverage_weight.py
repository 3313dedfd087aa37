"""The inverse coverage as a residual's weight: the laws it must reduce to, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest
from test_homogenisation import SIZE, loss_of, pictures
from test_start import ring

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.pose import look_at
from rift_cl.reference.spectrum import spectrally_filtered
from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.targets.observations import Observations
from rift_cl.train.loss.coverage_weight import CoverageWeight
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.loss.homogenised_loss import HomogenisedLoss
from rift_cl.train.start.points import field_diameter, focus_of

pytestmark = pytest.mark.once

EDGE = 256


def along(directions):
    """Orthographic views of EDGE x EDGE pixels of edge 1."""
    K = [[1, 0, EDGE / 2], [0, 1, EDGE / 2], [0, 0, 1]]
    return [
        Camera((EDGE, EDGE), K, look_at(10 * n, (0, 0, 0), (0, 0, 1)), "ortho") for n in directions
    ]


def around(count):
    angles = np.arange(count) * 2 * np.pi / count
    return along(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1))


def over_sphere(count):
    k = np.arange(count)
    z, turn = (k + 0.5) / count * 2 - 1, k * np.pi * (3 - np.sqrt(5))
    side = np.sqrt(1 - z**2)
    return along(np.stack([side * np.cos(turn), side * np.sin(turn), z], axis=1))


# From where the window has no more say to where pixels have one, below Crowther's frequency.
LAW = np.array([0.012, 0.02, 0.04, 0.08])


@pytest.mark.parametrize("exponent", [0.5, 1.0])
def test_a_ring_gives_the_ramp_along_the_detectors_rows(device, exponent):
    weight = CoverageWeight(around(720), device).response(5, exponent)
    for height in (0.0, 0.01, -0.06):
        ratio = weight(np.full(4, height), LAW) / LAW**exponent
        assert ratio.max() / ratio.min() < 1.1
    # Along a column at the rows' zero frequency all views see the same: nothing favours detail.
    column = weight(LAW[:3], np.zeros(3))
    assert column.max() / column.min() < 1.3


def test_views_all_over_the_sphere_give_the_ramp_in_every_direction(device):
    weight = CoverageWeight(over_sphere(1500), device).response(700, 1.0)
    turns = np.linspace(0, np.pi, 9)[:, None]
    ratio = weight(np.sin(turns) * LAW, np.cos(turns) * LAW) / LAW
    assert ratio.max() / ratio.min() < 1.25


def test_beyond_crowthers_frequency_a_view_alone_knows_its_slice(device):
    weight = CoverageWeight(around(12), device).response(0, 1.0)
    # 12 views in pairs that see the same: K / (pi D) is 0.0075 cycles per pixel.
    far = weight(np.zeros(3), np.array([0.03, 0.05, 0.08]))
    np.testing.assert_allclose(far, 0.5, rtol=0.05)


def test_the_weight_is_one_over_the_twins_coverage(device):
    cameras = ring(5)
    weights, middle = CoverageWeight(cameras, device), focus_of(cameras)
    kx, ky = np.array([0.11, -0.05, 0.3, 0.0]), np.array([0.02, 0.3, -0.21, 0.2])
    camera = cameras[2]
    depth = camera.view[2, :3] @ middle + camera.view[2, 3]
    k = kx[:, None] * camera.view[0, :3] + ky[:, None] * camera.view[1, :3]
    k *= camera.intrinsics[0] / depth
    wanted = (
        1 / host_coverage(Observations.of(cameras, middle[None]), k, field_diameter(cameras))[0]
    )
    # The grid's cells are coarse where slices of others meet this one.
    np.testing.assert_allclose(weights.response(2, 1.0)(ky, kx), wanted, rtol=0.35)


def test_the_weight_is_even_smooth_and_finite(device):
    weight = CoverageWeight(ring(9), device).response(1, 0.7)
    random = np.random.default_rng(0)
    ky, kx = random.uniform(-0.5, 0.5, (2, 4000))
    found = weight(ky, kx)
    assert (found > 0).all() and np.isfinite(found).all()
    np.testing.assert_allclose(weight(-ky, -kx), found, rtol=1e-9)
    # Angles meet round the half turn.
    ends = weight(np.array([1e-9, -1e-9]), np.array([0.2, 0.2]))
    assert ends[0] == pytest.approx(ends[1])


def test_what_a_blurred_picture_cannot_hold_gets_no_endless_weight(device):
    lens = Aperture(0.5, 2.0, 1e-2)
    cameras = [Camera(c.size, c.K, c.view, aperture=lens) for c in ring(4)]
    weight = CoverageWeight(cameras, device).response(0, 1.0)
    ky, kx = np.random.default_rng(1).uniform(-0.5, 0.5, (2, 500))
    assert weight(ky, kx).max() == pytest.approx(10)


def test_a_view_that_looks_elsewhere_keeps_the_plain_residual(device):
    cameras = ring(6)
    away = cameras[0].view.copy()
    away[0, 3] += 100
    weight = CoverageWeight([*cameras, Camera(cameras[0].size, cameras[0].K, away)], device)
    assert (weight.response(6, 1.0)(np.array([0.1, 0.0]), np.array([0.0, 0.4])) == 1).all()


def test_each_view_has_a_filter_of_its_own(device):
    (image, target), sent = pictures(device)
    weight = CoverageWeight(ring(3), device)
    settings = Homogenisation(0.8, weight="coverage")
    loss = HomogenisedLoss(device, settings, ssim_weight=0.0, kind="l2", coverage=weight)
    plain = 2 * (image.astype(float) - target) / target.size
    for view in (0, 1, 0):
        found = device.get(loss(*sent, view=view)[1])
        wanted = spectrally_filtered(plain, weight.response(view, 0.8), (32, 32))
        wanted *= np.linalg.norm(plain) / np.linalg.norm(wanted)
        np.testing.assert_allclose(found, wanted, atol=2e-6 * np.abs(wanted).max())


def test_the_ramp_does_not_look_at_the_view(device):
    _, sent = pictures(device)
    loss = loss_of(device, 0.5)
    ones = [device.get(loss(*sent, view=view)[1]).tobytes() for view in (0, 3)]
    assert ones[0] == ones[1] and SIZE == (24, 30)


def test_coverage_that_is_missing_and_unknown_weights_are_refused(device):
    with pytest.raises(InputError, match="coverage"):
        loss_of(device, 0.5, weight="coverage")
    with pytest.raises(InputError, match="weight is 'voronoi'"):
        Homogenisation(0.5, weight="voronoi")
