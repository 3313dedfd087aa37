"""Gradients of colours by lobes: the device against the twin, the twin against differences."""

from __future__ import annotations

import numpy as np
import pytest
from lobe_scenes import (
    CAMERA,
    CASES,
    MOST_MODES,
    Lobes,
    error,
    facing,
    random_lobes,
    seen,
    seen_grad,
)
from projection_scenes import camera_of

from rift_cl.basis.angular import SphericalHarmonics
from rift_cl.reference.lobes import shade_lobes, shade_lobes_grad

NAMES = ("linear", "lobes", "means", "view")


def incoming_for(given, seed=2):
    random = np.random.default_rng(seed)
    return random.standard_normal((len(given.means), 3)).astype(np.float32)


@pytest.mark.full
@pytest.mark.once
@pytest.mark.parametrize("kind, count", MOST_MODES)
def test_gradients_of_most_modes_are_the_twins(device, kind, count):
    check_gradients(device, kind, count)


@pytest.mark.each
@pytest.mark.parametrize("kind, count", CASES)
def test_gradients_are_the_twins(device, kind, count):
    check_gradients(device, kind, count)


def check_gradients(device, kind, count):
    for given in (random_lobes(kind, count), facing(random_lobes(kind, count))):
        incoming = incoming_for(given)
        found, twin = seen_grad(device, given, incoming), given.gradients(incoming)
        for name in NAMES:
            assert error(found[name], getattr(twin, name)) < 1e-4, name
        assert not found["lens"].any()


@pytest.mark.full
@pytest.mark.parametrize("kind, count", [("sg", 4), ("lg", 9)])
def test_gradients_of_parallel_rays_are_the_twins(device, kind, count):
    """They flow to the camera's axis, and to no mean."""
    given, camera = random_lobes(kind, count), camera_of("ortho")
    incoming = incoming_for(given)
    found, twin = (
        seen_grad(device, given, incoming, camera=camera),
        given.gradients(incoming, camera),
    )
    for name in ("linear", "lobes", "view"):
        assert error(found[name], getattr(twin, name)) < 1e-4, name
    assert not found["means"].any() and not found["view"][:2].any() and found["view"][2, :3].all()


@pytest.mark.parametrize("kind, count", [("sg", 4), ("lg", 9)])
def test_gradients_are_added_to_means_and_camera(device, kind, count):
    given = random_lobes(kind, count)
    incoming = incoming_for(given)
    plain, added = (seen_grad(device, given, incoming, before=before) for before in (0.0, 1.0))
    np.testing.assert_allclose(added["means"] - 1, plain["means"], atol=1e-6)
    np.testing.assert_allclose(added["view"] - 200, plain["view"], atol=2e-3)
    for name in ("linear", "lobes"):
        np.testing.assert_array_equal(added[name], plain[name])


def test_splats_that_are_not_drawn_have_no_gradient(device):
    given = random_lobes("asg", 4)
    culled = (np.arange(200) % 2).astype(np.uint8)
    features = seen(device, given, culled=culled)
    found = seen_grad(device, given, incoming_for(given), features=features)
    for name in ("linear", "lobes", "means"):
        assert not found[name][1::2].any() and found[name][::2].any()


@pytest.mark.parametrize("kind, count", CASES + MOST_MODES)
def test_gradients_of_the_twin_are_its_differences(kind, count):
    given = bright(facing(random_lobes(kind, count, 8), aside=0.3))
    arrays, incoming = list(given.exact()), incoming_for(given).astype(float)
    # Away from the limits of widths.
    if kind in ("hg", "lg"):
        arrays[2][:, 4:] = np.clip(arrays[2][:, 4:], np.log(0.1), -0.1)
    found = shade_lobes_grad(given.basis, *arrays, CAMERA, incoming)
    check_differences(given.basis, arrays, incoming, found)


def test_so_are_those_of_harmonics():
    given = bright(random_lobes("lg", 16, 8))
    means, linear, _ = given.exact()
    incoming = incoming_for(given).astype(float)
    basis = SphericalHarmonics(3)
    found = shade_lobes_grad(basis, means, linear, None, CAMERA, incoming)
    assert found.lobes.shape == (8, 0)
    check_differences(basis, [means, linear, None], incoming, found)


@pytest.mark.parametrize("kind, count", [("sg", 4), ("asg", 4)])
def test_so_are_those_of_parallel_rays(kind, count):
    given, camera = bright(random_lobes(kind, count, 8)), camera_of("ortho")
    arrays, incoming = list(given.exact()), incoming_for(given).astype(float)
    found = shade_lobes_grad(given.basis, *arrays, camera, incoming)
    check_differences(given.basis, arrays, incoming, found, camera)


def bright(given):
    """Nothing near the edge of being held at zero."""
    linear = 0.1 * given.linear
    linear[:, 0] += 4
    return Lobes(given.kind, given.means, linear, given.lobes)


def check_differences(basis, arrays, incoming, found, camera=CAMERA):
    """Directional derivatives along a few random directions of each argument."""
    random = np.random.default_rng(5)

    def loss(means, linear, lobes, camera=camera):
        return (shade_lobes(basis, means, linear, lobes, camera) * incoming).sum()

    for place, gradient in enumerate((found.means, found.linear, found.lobes)):
        if arrays[place] is None:
            continue
        for _ in range(3):
            along = random.standard_normal(gradient.shape)
            changed = [
                [a if k != place else a + step * along for k, a in enumerate(arrays)]
                for step in (1e-6, -1e-6)
            ]
            slope = (loss(*changed[0]) - loss(*changed[1])) / 2e-6
            np.testing.assert_allclose((gradient * along).sum(), slope, rtol=2e-6, atol=2e-7)
    for _ in range(3):
        along = np.vstack([random.standard_normal((3, 4)), np.zeros(4)])
        views = [Moved(camera.view + step * along, camera.model) for step in (1e-6, -1e-6)]
        slope = (loss(*arrays, views[0]) - loss(*arrays, views[1])) / 2e-6
        np.testing.assert_allclose((found.view * along[:3]).sum(), slope, rtol=2e-6, atol=2e-7)


class Moved:
    """A camera whose view matrix is any matrix: what the twin needs of one."""

    def __init__(self, view, model):
        self.view, self.model = view, model
        self.center = -np.linalg.inv(view[:3, :3]) @ view[:3, 3]
