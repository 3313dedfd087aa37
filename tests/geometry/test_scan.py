"""Parallel scans: their normal form, what they refuse, and that nobody can change them."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from rift_cl import Cone, Fan, Parallel
from rift_cl.errors import InputError, ShapeError

# Anything but round numbers, which look like degrees.
any_angle = st.floats(-100, 100).map(lambda angle: angle + 1e-3)
angle_lists = arrays.arrays(np.float64, st.integers(1, 20), elements=any_angle)


def test_normal_form():
    scan = Parallel([0, 1, 2], 7, pitch=2)
    assert scan.angles.dtype == np.float64
    assert scan.angles.tolist() == [0.0, 1.0, 2.0]
    assert (scan.bins, scan.pitch, scan.center) == (7, 2.0, 3.0)
    assert [type(v) for v in (scan.bins, scan.pitch, scan.center)] == [int, float, float]
    assert scan == Parallel(np.arange(3, dtype=np.float32), np.int64(7), np.float32(2), 3)


def test_center_is_the_middle_unless_given():
    assert Parallel([0.0], 7).center == 3.0
    assert Parallel([0.0], 8).center == 3.5
    assert Parallel([0.0], 1).center == 0.0
    assert Parallel([0.0], 8, center=-2.25).center == -2.25
    assert Parallel([0.0], 8, center=0).center == 0.0


def test_coordinates():
    assert Parallel([0.0], 4).coordinates().tolist() == [-1.5, -0.5, 0.5, 1.5]
    assert Parallel([0.0], 3, 0.5, 2.0).coordinates().tolist() == [-1.0, -0.5, 0.0]
    assert Parallel([0.0], 3).coordinates().dtype == np.float64


@given(angle_lists, st.integers(1, 100), st.floats(1e-3, 1e3), st.floats(-100, 200))
def test_axis_is_seen_at_the_center(angles, bins, pitch, center):
    t = Parallel(angles, bins, pitch, center).coordinates()
    np.testing.assert_allclose(t + center * pitch, np.arange(bins) * pitch, atol=1e-10 * pitch)


@given(angle_lists)
def test_any_order_and_range_of_angles_is_kept(angles):
    assert Parallel(angles, 3).angles.tolist() == angles.tolist()


@pytest.mark.parametrize(
    "angles",
    [
        np.arange(180),
        np.linspace(0, 180, 91),
        np.linspace(0, 360, 77, endpoint=False).astype(np.float32),
        np.arange(-60, 61, 3),
        np.linspace(0, 120, 77),
        np.r_[0:40, 50:200:0.5],
        np.r_[0, 137.5, 275, 52.5, 190, 327.5, 105, 242.5],
        np.arange(180) + 1e-3 * np.sin(np.arange(180)),
        np.linspace(0, 360, 200) + 0.05 * np.cos(3 * np.arange(200)),
        np.arange(100) * 137.50776,
        -np.arange(100) * 137.508,
        np.arange(50) * 111.246 % 180,
        np.linspace(0, 90, 7),
        np.linspace(-7.5, 7.5, 15),
    ],
)
def test_degrees_are_refused(angles):
    with pytest.raises(InputError, match="degrees"):
        Parallel(angles, 3)


@pytest.mark.parametrize(
    "angles",
    [
        np.deg2rad(np.arange(720)),
        np.arange(90) * np.pi * (3 - np.sqrt(5)),
        np.arange(75) * np.pi * (3 - np.sqrt(5)),
        np.arange(200) * np.pi * (np.sqrt(5) - 1) / 2,
        np.arange(40) * 2.0 * np.pi / 7 * 3 - 20.5,
        np.random.default_rng(0).uniform(0, 180, 50),
        np.arange(75) * 2.3 + 0.01 * np.sin(np.arange(75)),
        np.arange(0, 13),
        [0, 45, 90],
        np.deg2rad(np.r_[0:40, 50:200:0.5]) + 40 * np.pi,
    ],
)
def test_radians_of_many_turns_are_no_degrees(angles):
    assert len(Parallel(angles, 3).angles) == len(angles)


@pytest.mark.parametrize("angles", [np.zeros((2, 2)), 1.0, [[1.0]], np.zeros((1, 3)), [], ()])
def test_angles_must_be_one_list(angles):
    with pytest.raises(ShapeError, match="Parallel: angles"):
        Parallel(angles, 4)


@pytest.mark.parametrize(
    "angles",
    [
        None,
        "abc",
        ["a"],
        [1j],
        [None],
        [[1], [2, 3]],
        {"a": 1},
        object(),
        [10**400],
        ["1"],
        np.array([1j]),
        np.ma.array([1.0, 2.0], mask=[True, False]),
    ],
)
def test_angles_must_be_numbers(angles):
    with pytest.raises(InputError, match="Parallel: angles is"):
        Parallel(angles, 4)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_angle_that_is_not_finite_is_named(bad):
    with pytest.raises(InputError, match=r"angles\[2\] is (nan|inf|-inf)"):
        Parallel([0.0, 1.0, bad, bad], 4)


@pytest.mark.parametrize("bins", [0, -1, 2.5, np.nan, np.inf, None, "7", [7, 8], 1j])
def test_bins_must_be_a_positive_whole_number(bins):
    with pytest.raises(ShapeError, match="Parallel: bins"):
        Parallel([0.0], bins)


@pytest.mark.parametrize(
    "pitch",
    [0, -1, np.nan, np.inf, None, "1", [1.0, 2.0], 1j, 10**400],
    ids=lambda v: type(v).__name__,
)
def test_pitch_must_be_a_positive_length(pitch):
    with pytest.raises(InputError, match="Parallel: pitch"):
        Parallel([0.0], 4, pitch)


@pytest.mark.parametrize(
    "center", [np.nan, np.inf, "middle", [1.0, 2.0], 1j, 10**400], ids=lambda v: type(v).__name__
)
def test_center_must_be_a_bin_number(center):
    with pytest.raises(InputError, match="Parallel: center"):
        Parallel([0.0], 4, center=center)


def test_angles_cannot_be_changed_and_are_nobody_elses():
    given = np.array([0.0, 1.0])
    scan = Parallel(given, 4)
    given[0] = 9
    assert scan.angles.tolist() == [0.0, 1.0]
    assert given.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        scan.angles[0] = 5
    with pytest.raises(dataclasses.FrozenInstanceError):
        scan.bins = 5
    locked = np.array([0.0, 1.0])
    locked.flags.writeable = False
    assert not np.shares_memory(Parallel(locked, 4).angles, locked)


def test_angles_in_any_memory_order():
    assert Parallel(np.arange(10.0)[::-2], 4).angles.flags.c_contiguous
    assert Parallel(np.arange(4, dtype=">f4"), 4) == Parallel(range(4), 4)


def test_equality_and_hash():
    scan = Parallel([0.0, 1.0], 4, 2.0, 1.5)
    assert scan == Parallel((0.0, 1.0), 4, 2.0)
    assert hash(scan) == hash(Parallel((0.0, 1.0), 4, 2.0))
    others = [
        Parallel([0.0, 1.5], 4, 2.0),
        Parallel([1.0, 0.0], 4, 2.0),
        Parallel([0.0], 4, 2.0),
        Parallel([0.0, 1.0], 5, 2.0, 1.5),
        Parallel([0.0, 1.0], 4, 1.0),
        Parallel([0.0, 1.0], 4, 2.0, 2.0),
    ]
    assert len({scan, *others}) == 7
    assert scan != "scan"


def test_zero_has_no_sign():
    assert Parallel([0.0], 3, center=0.0) == Parallel([-0.0], 3, center=-0.0)
    assert hash(Parallel([0.0], 3, center=0.0)) == hash(Parallel([-0.0], 3, center=-0.0))


def test_copies_are_equal_and_read_only():
    scan = Parallel([0.0, 1.0], 4)
    for copied in (pickle.loads(pickle.dumps(scan)), dataclasses.replace(scan)):
        assert copied == scan
        assert not copied.angles.flags.writeable


@pytest.mark.parametrize(
    ("kind", "others"),
    [(Parallel, (12,)), (Fan, (12, 1.0, 50.0, 80.0)), (Cone, (4, 12, 1.0, 50.0, 80.0))],
)
def test_what_is_taken_from_accepted_angles_is_not_refused_as_degrees(kind, others):
    """Every fifth angle is half a radian on, and two hundred and one end at a whole one."""
    whole = kind(np.arange(0, 50, 0.1), *others)
    with pytest.raises(InputError, match="degrees"):
        kind(whole.angles[::5].copy(), *others)
    for few in (whole.subset(np.arange(0, 500, 5)), whole.subset(np.arange(201))):
        for scan in (few, few.at(-few.angles)):
            assert pickle.loads(pickle.dumps(scan)) == scan == copy.deepcopy(scan)
            wider = dataclasses.replace(scan, bins=14, center=None)
            assert np.array_equal(wider.angles, scan.angles)
            assert scan.subset(np.arange(50)).views == 50
            assert scan.scaled(2.0).views == scan.views
            with pytest.raises(ValueError, match="read-only"):
                scan.angles[0] = 1


def test_repr_of_many_views_is_one_line():
    scan = Parallel(np.linspace(0, 3.1, 180), 256, pitch=0.5)
    assert repr(scan) == (
        "Parallel(angles=<180 numbers from 0 to 3.1>, bins=256, pitch=0.5, center=127.5)"
    )
    assert "angles=[0.0, 1.5]" in repr(Parallel([0, 1.5], 8))
    turn = np.linspace(0, 6.2, 90)
    vectors = Cone(turn, 8, 9, 0.1, source_to_axis=50, source_to_detector=99).vectors()
    assert "source=<90 x 3 numbers>, " in repr(vectors)
    assert "\n" not in repr(vectors)
