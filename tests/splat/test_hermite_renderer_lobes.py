"""Lobes through the renderer: drawn, differentiated, and refused where they do not fit."""

from __future__ import annotations

import numpy as np
import pytest
from hermite_frames import SIZE, drawn, few, image

from rift_cl.basis.angular import angular_basis
from rift_cl.errors import InputError, ShapeError

pytestmark = pytest.mark.dealt

FUNCTIONS = {"hg": 4, "lg": 4, "sg": 3, "asg": 3}


def lobed(kind):
    """Splats with modes and lobes of a kind."""
    random, values = np.random.default_rng(6), few(20, shape=1, color=1)
    functions = FUNCTIONS[kind]
    values["sh"] = np.float32(0.4 * random.standard_normal((20, functions, 3)))
    geometry = angular_basis(kind, functions).n_geometry
    values["lobes"] = np.float32(random.standard_normal((20, geometry)))
    # Widths and sharpnesses as logarithms that nothing holds.
    logarithms = {"hg": [4, 5], "lg": [4], "sg": range(3, geometry, 4)}
    logarithms["asg"] = [k for k in range(geometry) if k % 6 > 3]
    values["lobes"][:, list(logarithms[kind])] = -0.5 if kind in ("hg", "lg") else 0.5
    return values


@pytest.mark.full
@pytest.mark.parametrize("kind", FUNCTIONS)
def test_gradients_of_lobes_are_differences(device, kind):
    values, random = lobed(kind), np.random.default_rng(7)
    coming = random.normal(size=(*SIZE, 3)).astype(np.float32)
    renderer, frame = drawn(device, values, angular=kind)
    found = renderer.backward(frame, device.array(coming))
    for name in ("lobes", "sh"):
        way, step = random.standard_normal(values[name].shape), 3e-3

        def loss(shift, name=name):
            moved = values | {name: values[name] + shift}
            return (image(device, moved, angular=kind) * coming).sum()

        right = (loss(step * way) - loss(-step * way)) / (2 * step)
        gradient = device.get(getattr(found, name)).astype(float)
        assert gradient.any()
        scale = np.linalg.norm(gradient) * np.linalg.norm(way)
        assert abs((gradient * way).sum() - right) < 3e-3 * scale, name


def test_lobes_that_do_not_fit_are_refused(device):
    values = lobed("sg")
    with pytest.raises(InputError, match="have lobes"):
        drawn(device, values)
    with pytest.raises(ShapeError, match="lobes"):
        drawn(device, values, angular="hg")
    with pytest.raises(InputError, match="no lobes"):
        drawn(device, few(3), angular="sg")
