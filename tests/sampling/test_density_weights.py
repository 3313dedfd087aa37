"""Filters from sampling: one name for all kinds, and the laws that inverse coverage keeps."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Parallel
from rift_cl.errors import InputError, RiftError, ShapeError
from rift_cl.geometry.pose import look_at
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.compensation_3d import central_planes
from rift_cl.sampling.coverage.density_weights import KINDS, density_weights

DIAMETER = 40.0
K = np.array([0.0, 0.01, 0.05, 0.2, 0.5])
every_kind = pytest.mark.parametrize("kind", KINDS)


def random_scan(count=24, seed=0):
    return Parallel(np.random.default_rng(seed).uniform(0, np.pi, count), 64)


def fibonacci(count):
    z = (np.arange(count) + 0.5) / count
    turn, side = np.arange(count) * np.pi * (3 - np.sqrt(5)), np.sqrt(1 - z**2)
    return np.stack([side * np.cos(turn), side * np.sin(turn), z], axis=1)


@pytest.mark.parametrize("kind", COMPENSATIONS)
def test_kinds_that_filters_know_are_theirs_times_the_ramp(kind):
    scan = random_scan()
    wanted = K * Compensation(scan.angles, kind, DIAMETER)(K)
    np.testing.assert_allclose(density_weights(scan, DIAMETER, kind, frequencies=K), wanted)
    sights = np.random.default_rng(1).normal(size=(9, 3))
    views = [look_at(-n, (0, 0, 0), (0, 0, 1)) for n in sights]
    axes, k = np.array([view[:2, :3] for view in views]), np.array([[0.1, 0.0], [0.05, -0.2]])
    wanted = 2 * np.hypot(*k.T) * central_planes(axes, k, DIAMETER, kind)
    for given in (axes, sights):
        found = density_weights(given, DIAMETER, kind, frequencies=k)
        np.testing.assert_allclose(found, wanted, rtol=1e-6)


@every_kind
def test_even_angles_get_the_plain_ramp(kind):
    scan = Parallel(np.arange(30) * np.pi / 30, 64)
    found = density_weights(scan, DIAMETER, kind)
    wanted = np.fft.rfftfreq(64) * np.pi / 30
    np.testing.assert_allclose(found, np.broadcast_to(wanted, found.shape), rtol=2e-3, atol=1e-12)


def test_inverse_coverage_is_the_exact_filter_but_for_its_window():
    scan = random_scan()
    found, exact = (
        density_weights(scan, DIAMETER, kind, frequencies=K) for kind in ("coverage", "exact")
    )
    np.testing.assert_allclose(found.sum(0), exact.sum(0), rtol=1e-6)
    for column in (2, 3):
        ratio = found[:, column] / exact[:, column]
        assert np.corrcoef(found[:, column], exact[:, column])[0, 1] > 0.9
        assert ratio.min() > 0.4 and ratio.max() < 2.5


@every_kind
def test_at_zero_frequency_all_views_stand_for_as_much(kind):
    near = np.array([1e-6])
    shares = density_weights(random_scan(), DIAMETER, kind, frequencies=near)[:, 0] / near
    assert shares.sum() == pytest.approx(np.pi, rel=1e-3)
    if kind == "coverage":
        np.testing.assert_allclose(shares, np.pi / 24, rtol=1e-3)


def test_views_even_over_the_sphere_share_alike_on_average():
    k = np.array([[0.01, 0.0], [0.0, 0.05], [0.03, 0.04]])
    found = density_weights(fibonacci(300), DIAMETER, "coverage", frequencies=k)
    mean = found.mean(0) * 300
    np.testing.assert_allclose(mean, 2 * np.hypot(*k.T), rtol=0.1)
    assert (found.std(0) < 0.4 * found.mean(0)).all()


@pytest.mark.parametrize(
    ("views", "more", "problem"),
    [
        (random_scan(), {"kind": "voronoi"}, "kind is 'voronoi'"),
        (random_scan(), {"frequencies": [[0.1, 0.2]]}, "frequencies"),
        (np.eye(3), {}, "frequencies: wanted"),
        (np.eye(3), {"frequencies": [0.1]}, "frequencies"),
        (np.ones(3), {"frequencies": [[0.1, 0.2]]}, "views: wanted"),
        (np.zeros((2, 3)), {"frequencies": [[0.1, 0.2]]}, "is zero"),
    ],
)
def test_what_makes_no_sense_is_refused(views, more, problem):
    with pytest.raises(RiftError, match=problem):
        density_weights(views, DIAMETER, **more)
    with pytest.raises((InputError, ShapeError), match="diameter"):
        density_weights(random_scan(), 0.0)
