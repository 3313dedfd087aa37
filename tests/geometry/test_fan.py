"""Fan beams: the rays they stand for, their normal form, and what they refuse."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.fan import FanBeam

angles = st.floats(-10, 10)
lengths = st.floats(1e-3, 1e3)


@given(angles, lengths, st.floats(1, 10), lengths, st.floats(-5, 15))
def test_a_ray_is_the_parallel_ray_that_the_docstring_names(a, to_axis, ratio, pitch, center):
    fan = FanBeam(to_axis, ratio * to_axis, pitch, center)
    along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
    source = to_axis * np.array([np.sin(a), -np.cos(a)])
    u = (np.arange(10) - center) * pitch
    bins = source + fan.source_to_detector * across + u[:, None] * along
    gamma = fan.fan_angles(10)
    t = to_axis * np.sin(gamma)
    normal = np.stack([np.cos(a - gamma), np.sin(a - gamma)], axis=1)
    scale = np.abs(bins).max()
    np.testing.assert_allclose(normal @ source, t, atol=1e-9 * scale)
    np.testing.assert_allclose((normal * bins).sum(axis=1), t, atol=1e-9 * scale)


def test_a_source_far_away_is_a_parallel_beam():
    fan = FanBeam(1e9, 1e9, 0.5, 3)
    np.testing.assert_allclose(1e9 * np.sin(fan.fan_angles(8)), 0.5 * (np.arange(8) - 3), rtol=1e-9)
    assert fan.magnification == 1


def test_normal_form():
    fan = FanBeam(np.float32(2), 3, np.int64(1), 4)
    assert fan == FanBeam(2.0, 3.0, 1.0, 4.0) and hash(fan) == hash(FanBeam(2.0, 3.0, 1.0, 4.0))
    assert {type(value) for value in dataclasses.astuple(fan)} == {float}
    assert pickle.loads(pickle.dumps(fan)) == fan
    assert fan.magnification == 1.5
    with pytest.raises(dataclasses.FrozenInstanceError):
        fan.pitch = 2.0


@pytest.mark.parametrize("name", ["source_to_axis", "source_to_detector", "pitch", "center"])
@pytest.mark.parametrize("value", [np.nan, np.inf, "2", None, 1j, [1.0]])
def test_what_is_no_number_is_refused(name, value):
    usual = {"source_to_axis": 2.0, "source_to_detector": 3.0, "pitch": 1.0, "center": 4.0}
    with pytest.raises(InputError, match=f"FanBeam: {name} is"):
        FanBeam(**{**usual, name: value})


@pytest.mark.parametrize("lengths", [(0, 3, 1), (-2, 3, 1), (2, 3, 0), (2, 3, -1), (2, -3, 1)])
def test_lengths_are_positive(lengths):
    with pytest.raises(InputError, match="positive length"):
        FanBeam(*lengths, center=0)


def test_the_detector_stands_behind_the_axis():
    with pytest.raises(InputError, match="behind the axis"):
        FanBeam(3, 2, 1, 0)


@pytest.mark.parametrize("bins", [0, -1, 1.5, np.nan, "4"])
def test_bins_are_counted(bins):
    with pytest.raises(ShapeError, match="FanBeam: bins"):
        FanBeam(2, 3, 1, 0).fan_angles(bins)
