"""The coverage kernels: against their twin, in bits, in a small memory, and what they refuse."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from observations_of_all_kinds import random_observations, ring_of_cameras

import rift_cl as rift
from rift_cl.errors import InputError, ResourceLimitError, ShapeError
from rift_cl.geometry import Parallel
from rift_cl.sampling.coverage.device import coverage, coverage_grad
from rift_cl.sampling.coverage.host import host_coverage, host_coverage_grad
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

DIAMETER = 3.0
POINTS = [[0.1, 0, 0], [-0.5, 0.2, 0.4]]


@pytest.fixture
def target():
    return Target((0, 0, 0), DIAMETER, points=POINTS)


@pytest.fixture
def observations():
    return random_observations(23, 2, diameter=DIAMETER)


def off(found, wanted):
    return np.abs(found - wanted).max() / np.abs(wanted).max()


def test_it_is_the_twins(device, observations, target):
    found = coverage(observations, target, device=device)
    assert found.dtype == np.float32 and found.shape == (2, 1500)
    assert off(found, host_coverage(observations, target.k, DIAMETER)) < 2e-6


def test_the_gradient_is_the_twins(device, observations, target):
    upstream = np.random.default_rng(0).normal(size=(2, 1500))
    found = coverage_grad(observations, target, upstream, device=device)
    wanted = host_coverage_grad(observations, target.k, DIAMETER, upstream)
    for name in found._fields:
        assert off(getattr(found, name), getattr(wanted, name)) < 1e-4, name


@pytest.mark.parametrize("count", [1, 7, 8, 9, 1025])
def test_any_number_of_frequencies_will_do(device, observations, target, count):
    k = np.random.default_rng(count).normal(size=(count, 3))
    upstream = np.random.default_rng(1).normal(size=(2, count))
    found = coverage(observations, target, k, device=device)
    assert found.shape == (2, count)
    assert off(found, host_coverage(observations, k, DIAMETER)) < 2e-6
    by_weight = coverage_grad(observations, target, upstream, k, device=device).weight
    assert off(by_weight, host_coverage_grad(observations, k, DIAMETER, upstream).weight) < 1e-5


def test_a_view_that_is_skipped_adds_nothing(device):
    """Rows of a cube lie in long boxes that most slabs miss; in another order hardly any is."""
    target, observations = Target((0, 0, 0), 1.0), random_observations(40, 1)
    axis = np.linspace(-16, 16, 16)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    k = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    order = np.random.default_rng(0).permutation(len(k))
    np.testing.assert_array_equal(
        coverage(observations, target, k, device=device)[:, order],
        coverage(observations, target, k[order], device=device),
    )


def test_a_small_memory_changes_no_bit(device, observations, target):
    k = np.random.default_rng(3).normal(size=(6000, 3))
    upstream = np.random.default_rng(4).normal(size=(2, 6000))
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=60_000)
    np.testing.assert_array_equal(
        coverage(observations, target, k, device=small),
        coverage(observations, target, k, device=device),
    )
    found = coverage_grad(observations, target, upstream, k, device=small)
    for name, values in (
        coverage_grad(observations, target, upstream, k, device=device)._asdict().items()
    ):
        np.testing.assert_array_equal(getattr(found, name), values)
    tiny = rift.Device(device._handle, device.selector, traits=device.traits, memory=2_000)
    with pytest.raises(ResourceLimitError, match="point's views"):
        coverage(observations, target, k, device=tiny)


def test_two_runs_give_the_same_bits(device, observations, target):
    upstream = np.random.default_rng(5).normal(size=(2, 1500))
    first, second = (coverage_grad(observations, target, upstream, device=device) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_unit_of_length_does_not_matter(device, observations, target):
    scale = 1e9
    large = dataclasses.replace(
        observations,
        pixel=observations.pixel * scale,
        cutoff=observations.cutoff / scale,
        blur=observations.blur * scale,
    )
    far = Target((0, 0, 0), DIAMETER * scale, points=POINTS)
    found = coverage(large, far, target.k / scale, device=device)
    np.testing.assert_allclose(found, coverage(observations, target, device=device), atol=1e-5)


def test_cameras_and_their_looks_are_the_same(device):
    cameras, target = ring_of_cameras(5), Target((0, 0, 0), 2.0, points=POINTS)
    observations = Observations.of(cameras, POINTS, weights=[1, 2, 3, 4, 5])
    np.testing.assert_array_equal(
        coverage(cameras, target, weights=[1, 2, 3, 4, 5], device=device),
        coverage(observations, target, device=device),
    )


def test_a_scan_covers_what_its_directions_do(device):
    angles = np.linspace(0, np.pi, 20, endpoint=False)
    target = Target.flat(10.0)
    scan = Parallel(angles, bins=64, pitch=0.01)
    lines = np.stack([-np.sin(angles), np.cos(angles), 0 * angles], axis=1)
    found = coverage(scan, target, device=device)
    bare = coverage(Observations.along(lines), target, device=device)
    np.testing.assert_allclose(found, bare, atol=1e-3 * bare.max())


def test_what_no_view_sees_is_not_covered(device):
    cameras = ring_of_cameras(4)
    target = Target((100, 0, 0), 1.0)
    assert coverage(cameras, target, device=device).max() == 0


@pytest.mark.parametrize(
    ("k", "wanted"),
    [
        ([[0, 0]], "k has shape"),
        (np.empty((0, 3)), "at least one"),
        ([[0, np.nan, 0]], "NaN"),
        ("text", "real numbers"),
        ([[1e9, 0, 0]], "unit of the diameter"),
    ],
)
def test_bad_frequencies_are_refused(observations, target, k, wanted):
    with pytest.raises(InputError, match=wanted):
        coverage(observations, target, k)


def test_bad_views_and_gradients_are_refused(observations, target):
    with pytest.raises(ShapeError, match="cameras is empty"):
        coverage([], target)
    with pytest.raises(ShapeError, match=r"2 points.*1"):
        coverage(observations, Target((0, 0, 0), 1.0))
    with pytest.raises(InputError, match="weights"):
        coverage(observations, target, weights=[1.0])
    with pytest.raises(InputError, match="too large for float32"):
        coverage(ring_of_cameras(1), Target((0, 0, 0), 1.0), weights=[1e39])
    with pytest.raises(ShapeError, match="grad has shape"):
        coverage_grad(observations, target, np.zeros((1, 3)))
    with pytest.raises(InputError, match="NaN"):
        coverage_grad(observations, target, np.full((2, 1500), np.nan))
