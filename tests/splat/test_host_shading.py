"""A registered angular basis is shaded on the host, to what a kernel gives."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.basis.angular import ANGULAR_BASES, SphericalGaussians, register_angular_basis
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.splat import Renderer, Splats, SplatSettings


@pytest.fixture
def twin():
    register_angular_basis("twin", SphericalGaussians.of_count)
    yield "twin"
    ANGULAR_BASES.remove("twin")


def rendered(device, angular, model):
    random = np.random.default_rng(3)
    values = {
        "means": random.uniform(-1, 1, (40, 3)),
        "quats": random.normal(size=(40, 4)),
        "scales": random.uniform(0.05, 0.2, (40, 3)),
        "opacities": random.uniform(0.2, 0.9, 40),
        "sh": random.normal(size=(40, 3, 3)),
        "lobes": random.normal(size=(40, SphericalGaussians.of_count(3).n_geometry)),
    }
    view = np.eye(4)
    view[:3, 3] = 0.1, -0.2, 4
    view[:2, :2] = [[0.8, 0.6], [-0.6, 0.8]]
    camera = Camera((24, 28), [[30, 0, 14], [0, 30, 12], [0, 0, 1]], view, model)
    renderer = Renderer(SplatSettings(angular=angular), device=device)
    frame = renderer.forward(Splats.upload(device, **values), camera)
    incoming = device.array(random.normal(size=frame.image.shape))
    found = renderer.backward(frame, incoming, with_camera=True)
    arrays = frame.image, found.sh, found.lobes, found.splats.means, found.camera
    return [device.get(array) for array in arrays]


@pytest.mark.parametrize("model", ["pinhole", "ortho"])
def test_the_host_gives_what_the_kernel_gives(device, twin, model):
    found = (rendered(device, angular, model) for angular in (twin, "sg"))
    for one, other in zip(*found, strict=True):
        assert np.abs(other).max() > 0.1
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-4 * np.abs(other).max())


@pytest.mark.parametrize("name", ["sg", "Two words", "", 3])
def test_names_that_are_taken_or_cannot_be_saved_are_refused(name):
    with pytest.raises(InputError, match="angular"):
        register_angular_basis(name, SphericalGaussians.of_count)
