"""A step of Adam inside the gradient of shading: the same bits as the one after the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_parameters import RATES, raw_values

from rift_cl.basis.angular import angular_basis
from rift_cl.errors import ShapeError
from rift_cl.geometry import Camera
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters

pytestmark = [pytest.mark.dealt, pytest.mark.variants]

SIZE = (24, 40)
K = np.array([[30, 0, 20], [0, 30, 12], [0, 0, 1]], np.float32)
VIEW = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]], np.float32)
CAMERA = Camera(SIZE, K, VIEW)


def values_of(angular, functions, count):
    """Splats of which some are behind the camera, black in a channel, or no numbers."""
    raw = raw_values(count, functions)
    raw["means"][2, 2], raw["sh"][5, 0] = -9, -3
    raw["sh"][count // 2, -1, 1] = np.nan
    if angular != "sh":
        shape = (count, angular_basis(angular, functions).n_geometry)
        raw["lobes"] = np.random.default_rng(4).normal(size=shape).astype(np.float32)
    return raw


def stepped(device, raw, angular, rest, *, inside):
    """Two steps; all that is trained with its moments, and the camera's gradient."""
    parameters = Parameters.of(device, raw)
    renderer = Renderer(SplatSettings(angular=angular), device=device)
    by_image = np.random.default_rng(5).normal(size=(*SIZE, 3)).astype(np.float32)
    rates = RATES | {"lobes": 1e-2}
    for _ in range(2):
        frame = renderer.forward(parameters.drawn, CAMERA)
        step = parameters.sh_step(rates, sh_rest=rest) if inside else None
        found = renderer.backward(frame, device.array(by_image), with_camera=True, sh_step=step)
        assert (found.sh is None) == inside
        parameters.update(found, rates, sh_rest=rest, opacity_penalty=0.1, scale_penalty=0.1)
    return [*parameters.host(), {"camera": device.get(found.camera)}]


@pytest.mark.parametrize("moment", ["first", "second"])
def test_moments_of_another_shape_are_refused(device, moment):
    parameters = Parameters.of(device, values_of("sh", 4, 20))
    renderer = Renderer(device=device)
    frame = renderer.forward(parameters.drawn, CAMERA)
    step = parameters.sh_step(RATES, sh_rest=1.0)
    step = replace(step, **{moment: device.zeros((19, 4, 3))})
    with pytest.raises(ShapeError, match=moment):
        renderer.backward(frame, device.zeros((*SIZE, 3)), sh_step=step)


@pytest.mark.parametrize(
    "angular, functions, count, rest",
    [
        ("sh", 1, 37, 1.0),
        ("sh", 9, 70, 0.05),
        pytest.param("sh", 16, 64, 0.05, marks=pytest.mark.full),
        ("sg", 4, 37, 0.05),
    ],
)
def test_steps_inside_have_the_bits_of_steps_afterwards(device, angular, functions, count, rest):
    raw = values_of(angular, functions, count)
    after, inside = (stepped(device, raw, angular, rest, inside=one) for one in (False, True))
    for expected, found in zip(after, inside, strict=True):
        for name, array in expected.items():
            assert np.array_equal(found[name], array, equal_nan=True), name
    changed = inside[0]["sh"] != raw["sh"]
    assert changed.any() and np.count_nonzero(inside[1]["sh"]) > count
