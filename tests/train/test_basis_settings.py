"""Which modes a fit may have, when they join, and where lobes point at first."""

from __future__ import annotations

import numpy as np
import pytest
from test_start import ring

from rift_cl.errors import InputError
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.settings import LearningRates, TrainSettings
from rift_cl.train.start.lobes import lobe_axes
from rift_cl.train.start.points import focus_of
from rift_cl.train.strategy import DefaultSettings

NAN = float("nan")


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        (BasisSettings, {"kind": "wavelet"}, "kind is 'wavelet'"),
        (BasisSettings, {"kind": "hermite", "order": 9}, "order is 9"),
        (BasisSettings, {"kind": "hermite", "order": -1}, "order is -1"),
        (BasisSettings, {"kind": "hermite", "order": 1.5}, "order is 1.5"),
        (BasisSettings, {"kind": "laguerre", "color_order": 9}, "color_order is 9"),
        (BasisSettings, {"order": 1}, "order is 1 and kind is 'gaussian'.*use 'hermite'"),
        (BasisSettings, {"color_order": 2}, "color_order is 2 and kind is 'gaussian'"),
        (BasisSettings, {"activation": "gate"}, "activation is 'gate'"),
        (BasisSettings, {"first": 1.1}, r"first is 1.1"),
        (BasisSettings, {"every": NAN}, "every is nan"),
        (BasisSettings, {"ridge": -1}, "ridge is -1"),
        (BasisSettings, {"ridge": "much"}, "ridge is 'much'"),
        (AngularSettings, {"kind": "cubes"}, "kind is 'cubes'"),
        (AngularSettings, {"modes": 0}, "modes is 0"),
        (AngularSettings, {"kind": "sg", "modes": 36}, "modes is 36"),
        (AngularSettings, {"first": -0.1}, "first is -0.1"),
        (LearningRates, {"shape_modes": -1}, "shape_modes is -1"),
        (LearningRates, {"lobes": NAN}, "lobes is nan"),
    ],
)
def test_what_is_out_of_range_is_named(kind, changes, words):
    with pytest.raises(InputError, match=f"{kind.__name__}: {words}"):
        kind(**changes)


def test_magnitudes_of_gradients_are_for_plain_splats():
    sums = DefaultSettings(absgrad=True)
    assert TrainSettings(strategy=sums).basis.plain
    for basis in (BasisSettings("hermite", 1), BasisSettings(activation="exp")):
        with pytest.raises(InputError, match="absgrad wants magnitudes"):
            TrainSettings(strategy=sums, basis=basis)


def test_orders_join_one_after_the_other():
    basis = BasisSettings("hermite", 3, 1, first=0.2, every=0.1)
    found = [basis.order_at(step, 100) for step in (0, 19, 20, 29, 30, 39, 40, 99, 100)]
    assert found == [0, 0, 1, 1, 2, 2, 3, 3, 3]
    assert BasisSettings("hermite", 3, first=0, every=0).order_at(0, 100) == 3
    assert BasisSettings("hermite", 0, 2, first=0).order_at(0, 10) == 1
    assert BasisSettings().order_at(100, 100) == 0


@pytest.mark.parametrize(
    ("settings", "numbers"),
    [
        ({"sh_degree": 0}, 14),
        ({"sh_degree": 3}, 59),
        ({"sh_degree": 0, "basis": BasisSettings("hermite", 2, 1)}, 14 + 9 + 9),
        ({"angular": AngularSettings("lg", 8)}, 11 + 27 + 5),
        ({"angular": AngularSettings("sg", 4)}, 11 + 15 + 16),
    ],
)
def test_a_fit_knows_how_many_numbers_a_splat_has(settings, numbers):
    assert TrainSettings(**settings).numbers == numbers


def scattered(count=200):
    random = np.random.default_rng(2)
    return {
        "means": (focus_of(ring(8)) + random.normal(0, 0.5, (count, 3))).astype(np.float32),
        "quats": random.normal(size=(count, 4)).astype(np.float32),
        "log_scales": np.zeros((count, 3), np.float32),
    }


def test_round_splats_have_lobes_along_the_views_from_their_own_side():
    raw, cameras = scattered(), ring(8)
    axes = lobe_axes(raw, cameras)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1, rtol=1e-12)
    outward = raw["means"] - focus_of(cameras)
    # Cameras on a ring say nothing of splats above or below its middle.
    level = outward * [1, 1, 0]
    far = np.linalg.norm(level, axis=1) > 0.9 * np.linalg.norm(outward, axis=1)
    assert ((axes * level).sum(axis=1)[far] < 0).all()


def test_discs_have_lobes_across_them_that_cameras_look_along():
    raw, cameras = scattered(), ring(8)
    raw["quats"][:] = 1, 0, 0, 0
    raw["log_scales"][:, 2] = -2
    axes = lobe_axes(raw, cameras)
    np.testing.assert_allclose(np.abs(axes), np.tile([0, 0, 1.0], (200, 1)), atol=1e-12)
    raw["log_scales"][:, 2] = 0
    along = lobe_axes(raw, cameras)
    assert ((axes * along).sum(axis=1) >= 0).all()


def test_a_splat_where_no_axis_is_known_has_one_all_the_same():
    cameras = ring(8)
    raw = {name: value[:2] for name, value in scattered().items()}
    raw["means"][:] = focus_of(cameras), cameras[0].center
    raw["quats"][:] = 0
    axes = lobe_axes(raw, cameras)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1)
