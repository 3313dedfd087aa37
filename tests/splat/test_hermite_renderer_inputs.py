"""Splats with Hermite modes: what is no number, does not fit or is not there."""

from __future__ import annotations

import numpy as np
import pytest
from hermite_frames import SIZE, drawn, few, image
from projection_scenes import random_splats

from rift_cl.errors import InputError, ShapeError
from rift_cl.reference.hermite_projection import splat_roots
from rift_cl.splat import Splats, SplatSettings
from rift_cl.splat.orders import count_of, order_of
from rift_cl.splat.projection import CULL_REASONS

pytestmark = pytest.mark.dealt


@pytest.mark.full
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 1e30])
@pytest.mark.parametrize("name", ["shape_modes", "color_modes"])
def test_splats_whose_modes_are_no_numbers_are_left_out(device, name, number):
    values = few()
    without = {n: np.delete(v, [3, 17], axis=0) for n, v in values.items()}
    values[name][3].flat[1], values[name][17].flat[-1] = number, number
    renderer, frame = drawn(device, values)
    codes = device.get(frame.projection.culled)
    assert [CULL_REASONS[codes[i]] for i in (3, 17)] == ["not finite or degenerate"] * 2
    found = renderer.backward(frame, device.array(np.ones((*SIZE, 3), np.float32)))
    np.testing.assert_array_equal(device.get(frame.image), image(device, without))
    for gradient in (found.splats.means, found.shape_modes, found.color_modes, found.sh):
        host = device.get(gradient)
        assert np.isfinite(host).all() and not host[[3, 17]].any()


@pytest.mark.full
def test_a_splat_whose_modes_outshine_it_is_drawn(device):
    """Its own peak is under 1/255, what its modes make of it is not."""
    values = {
        "means": np.zeros((1, 3)), "quats": np.array([[1, 0, 0, 0]]),
        "scales": np.full((1, 3), 0.3), "opacities": np.array([0.003]), "colors": np.ones((1, 1)),
        "shape_modes": np.array([[30.0, 0, 0]]),
    }  # fmt: skip
    assert image(device, values).max() > 0.03
    values["shape_modes"] = values["shape_modes"] * 0
    assert image(device, values).max() == 0


@pytest.mark.full
def test_without_splats_there_is_the_background(device):
    values = {name: value[:0] for name, value in few(2).items()}
    renderer, frame = drawn(device, values)
    assert not device.get(frame.image).any()
    found = renderer.backward(frame, device.array(np.ones((*SIZE, 3), np.float32)))
    assert found.shape_modes.shape == (0, 9) and found.color_modes.shape == (0, 3, 3)


def upload(device, **changes):
    return Splats.upload(device, **(few(5) | changes))


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"shape_modes": np.zeros((5, 4))}, InputError, "shape_modes: 5 modes"),
        ({"shape_modes": np.zeros((5, 219))}, InputError, "220 modes"),
        ({"shape_modes": np.zeros((4, 3))}, ShapeError, r"shape_modes has shape \(4, 3\)"),
        ({"shape_modes": np.zeros((5, 3, 1))}, ShapeError, "shape_modes has shape"),
        ({"color_modes": np.zeros((5, 3))}, ShapeError, "color_modes has shape"),
        ({"color_modes": np.zeros((5, 3, 4))}, ShapeError, "wants to be 3, the channels"),
        ({"color_modes": np.zeros((5, 2, 3))}, InputError, "color_modes: 3 modes belong"),
        ({"lobes": np.zeros((5, 0))}, ShapeError, "lobes has shape"),
        ({"sh": None, "lobes": np.zeros((5, 4))}, InputError, "lobes want sh"),
        ({"sh": np.zeros((5, 3, 3))}, ShapeError, "sh has shape"),
        (
            {"quats": None, "scales": None, "covars": np.zeros((5, 6))},
            InputError,
            "shape_modes want quats and scales",
        ),
    ],
    ids=str,
)
def test_modes_that_do_not_fit_are_refused(device, changes, kind, words):
    with pytest.raises(kind, match=words):
        upload(device, **changes)


@pytest.mark.full
def test_what_is_not_there_is_refused(device):
    with pytest.raises(InputError, match="absgrad"):
        drawn(device, few(5), absgrad=True)
    with pytest.raises(InputError, match="absgrad"):
        drawn(device, random_splats(5), absgrad=True, activation="exp")
    many = few(5, color=0) | {"colors": np.ones((5, 30))}
    with pytest.raises(InputError, match="at most 32"):
        drawn(device, many)
    with pytest.raises(InputError, match=r"activation exp.*xray"):
        SplatSettings(mode="xray", activation="exp")
    for name in ("activation", "angular"):
        with pytest.raises(InputError, match=f"{name} is 'gauss'"):
            SplatSettings(**{name: "gauss"})


@pytest.mark.parametrize("bad", [9, -1, 1.5, "two"])
def test_orders_out_of_range_are_refused(bad):
    with pytest.raises(InputError, match="0 to 8"):
        count_of(bad)


@pytest.mark.parametrize("dim", [2, 3])
def test_orders_and_counts_undo_each_other(dim):
    assert [order_of(count_of(n, dim), dim) for n in range(9)] == list(range(9))


@pytest.mark.full
def test_covariances_take_an_activation(device):
    values = random_splats(30, coefficients=4, wide=1.0)
    roots = splat_roots(values["quats"].astype(float), values["scales"].astype(float))
    rest = {n: v for n, v in values.items() if n not in ("quats", "scales")}
    covars = rest | {"covars": roots @ roots.transpose(0, 2, 1)}
    coming = np.random.default_rng(0).normal(size=(*SIZE, 3)).astype(np.float32)
    means = []
    for given in (values, covars):
        renderer, frame = drawn(device, given, activation="exp")
        found = renderer.backward(frame, device.array(coming))
        means.append(device.get(found.splats.means))
    assert device.get(found.splats.covars).any()
    assert np.linalg.norm(means[0] - means[1]) < 1e-3 * np.linalg.norm(means[0])
