"""Cones and fans of a scan: the rays they stand for, their limits, and what they refuse."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.nearly_upright import nearly_upright

lengths = st.floats(1e-2, 1e2)
USUAL = {
    "angles": np.linspace(0, 6, 7),
    "rows": 10,
    "bins": 12,
    "pitch": (0.5, 0.4),
    "source_to_axis": 100.0,
    "source_to_detector": 150.0,
    "center": (3.0, 4.5),
    "heights": 0.1 * np.arange(7),
}


def cone(**changes):
    return rift.Cone(**{**USUAL, **changes})


def pixel(vectors, view, row, column):
    across = (column - (vectors.bins - 1) / 2) * vectors.across[view]
    return vectors.middle[view] + across + (row - (vectors.rows - 1) / 2) * vectors.down[view]


@given(st.floats(-10, 10), lengths, st.floats(1, 10), lengths, lengths, st.integers(0, 9))
def test_a_point_is_seen_where_the_docstring_says(angle, to_axis, ratio, row, column, k):
    scan = rift.Cone([angle], 8, 10, (row, column), to_axis, ratio * to_axis, (2.5, 7.25), [0.3])
    vectors = scan.vectors()
    x, y, z = vectors.source[0] + 0.37 * (pixel(vectors, 0, 3, k) - vectors.source[0])
    depth = to_axis - x * np.sin(angle) + y * np.cos(angle)
    u = scan.source_to_detector * (x * np.cos(angle) + y * np.sin(angle)) / depth
    v = scan.source_to_detector * (z - 0.3) / depth
    scale = max(to_axis * ratio, 10 * max(row, column))
    assert u == pytest.approx((k - 7.25) * column, abs=1e-9 * scale)
    assert v == pytest.approx((3 - 2.5) * row, abs=1e-9 * scale)


def test_the_line_from_the_source_to_the_centre_meets_the_axis_at_a_right_angle():
    vectors = cone().vectors()
    for view in range(vectors.views):
        ray = pixel(vectors, view, 3.0, 4.5) - vectors.source[view]
        at = vectors.source[view] + ray * (100 / 150)
        np.testing.assert_allclose(at, [0, 0, 0.1 * view], atol=1e-9)
        assert ray[2] == pytest.approx(0, abs=1e-9)


def test_a_cone_comes_back_from_its_vectors():
    found = rift.Cone.of_vectors(cone().vectors())
    for name in ("angles", "pitch", "source_to_axis", "source_to_detector", "center", "heights"):
        np.testing.assert_allclose(getattr(found, name), USUAL[name], atol=1e-9, err_msg=name)


@pytest.mark.parametrize("name", ["source", "middle", "across", "down"])
def test_vectors_that_are_not_circular_name_their_first_view(name):
    vectors = cone().vectors()
    values = {k: getattr(vectors, k).copy() for k in ("source", "middle", "across", "down")}
    values[name][4, 1] += 0.02
    moved = rift.Vectors(**values, rows=10, bins=12)
    with pytest.raises(InputError, match=r"view 4.*circular"):
        rift.Cone.of_vectors(moved)


def test_rows_that_grow_downwards_are_no_cone():
    vectors = cone().vectors()
    turned = rift.Vectors(vectors.source, vectors.middle, vectors.across, -vectors.down, 10, 12)
    with pytest.raises(InputError, match="rows"):
        rift.Cone.of_vectors(turned)


@pytest.mark.parametrize("turned_over", [False, True])
@pytest.mark.parametrize("mirrored", [False, True])
def test_vectors_that_are_nearly_a_cone_s_tell_how_their_images_lie(turned_over, mirrored):
    cone = rift.Cone(np.arange(20) * 0.3, 30, 40, 0.5, 60, 150, (12.0, 22.0))
    straight = cone.vectors()
    middle = straight.middle + 0.2 * np.random.default_rng(0).standard_normal((20, 3))
    down = -straight.down if turned_over else straight.down
    across = -straight.across if mirrored else straight.across
    vectors = rift.Vectors(straight.source, middle, across, down, 30, 40)
    found, *lie = nearly_upright(vectors)
    assert lie == [turned_over, mirrored] and found.source_to_axis == pytest.approx(60)
    assert found.center == pytest.approx(cone.center, abs=0.3)
    rising = replace(straight, source=straight.source + np.arange(20)[:, None] * [0, 0, 5])
    assert nearly_upright(rising) is None


def test_curved_rows_have_no_vectors_and_even_fan_angles():
    scan = cone(curved=True)
    np.testing.assert_allclose(scan.fan_angles(), (np.arange(12) - 4.5) * 0.4 / 150)
    with pytest.raises(InputError, match="curved"):
        scan.vectors()


def test_normal_form():
    scan = rift.Cone([0.0, 1.0], 4, 6, 0.5, 10, 20)
    assert (scan.pitch, scan.center, scan.magnification) == ((0.5, 0.5), (1.5, 2.5), 2.0)
    assert scan.heights.tolist() == [0.0, 0.0] and scan.circular and scan.views == 2
    assert not cone().circular
    for value in (scan, cone(), scan.fan(), scan.vectors()):
        again = pickle.loads(pickle.dumps(value))
        assert again == value and hash(again) == hash(value) and again.digest == value.digest
    assert scan != cone() and scan.fan() == rift.Fan([0.0, 1.0], 6, 0.5, 10, 20)
    with pytest.raises(ValueError, match="read-only"):
        scan.heights[0] = 1


def test_the_middle_row_is_a_fan():
    fan = cone().fan()
    np.testing.assert_array_equal(fan.fan_angles(), cone().fan_angles())
    assert fan.beam == rift.FanBeam(100, 150, 0.4, 4.5)


@pytest.mark.parametrize(
    ("change", "error", "what"),
    [
        ({"angles": []}, ShapeError, "angles"),
        ({"angles": [0, np.nan]}, InputError, "angles"),
        ({"angles": np.arange(0, 360, 2.0), "heights": None}, InputError, "degrees"),
        ({"angles": np.linspace(0, 180, 181), "heights": None}, InputError, "degrees"),
        ({"rows": 0}, ShapeError, "rows"),
        ({"bins": 1.5}, ShapeError, "bins"),
        ({"pitch": -1}, InputError, "pitch"),
        ({"pitch": (1, 2, 3)}, ShapeError, "pitch"),
        ({"source_to_axis": 0}, InputError, "source_to_axis"),
        ({"source_to_detector": 50}, InputError, "behind the axis"),
        ({"center": 4}, ShapeError, "center"),
        ({"center": (1, np.inf)}, InputError, "center"),
        ({"heights": [0, 1]}, ShapeError, "heights"),
        ({"heights": np.full(7, np.nan)}, InputError, "heights"),
        ({"curved": "yes"}, InputError, "curved"),
        ({"curved": True, "pitch": 80}, InputError, "pitch.*in one unit"),
    ],
)
def test_one_sentence_names_what_is_wrong(change, error, what):
    with pytest.raises(error, match=what):
        cone(**change)


def test_arcs_may_open_to_both_sides_by_less_than_half_a_turn():
    beam = {"pitch": 1.0, "source_to_axis": 2.0, "source_to_detector": 2.0, "curved": True}
    assert rift.Fan([0.0], 12, **beam).bins == 12
    with pytest.raises(InputError, match="Fan: pitch"):
        rift.Fan([0.0], 13, **beam)


def test_long_helices_in_radians_are_no_degrees():
    angles = np.arange(1000) * 0.2
    assert cone(angles=angles, heights=0.01 * angles).views == 1000


VECTORS = cone().vectors()


@pytest.mark.parametrize(
    ("name", "change", "error", "what"),
    [
        ("source", lambda v: v[:3], ShapeError, "lengths"),
        ("source", lambda v: v[:, :2], ShapeError, "source"),
        ("middle", lambda v: np.where(np.arange(7)[:, None] == 2, np.nan, v), InputError, r"\[2\]"),
        ("across", lambda v: VECTORS.down * 2, InputError, "parallel in view 0"),
        ("source", lambda v: VECTORS.middle + VECTORS.across, InputError, "plane of the detector"),
        ("down", lambda v: ["a"], InputError, "down"),
    ],
)
def test_vectors_name_the_view_that_is_wrong(name, change, error, what):
    values = {k: getattr(VECTORS, k) for k in ("source", "middle", "across", "down")}
    with pytest.raises(error, match=what):
        rift.Vectors(**{**values, name: change(values[name])}, rows=10, bins=12)


SCANS = [
    rift.Parallel(USUAL["angles"], 12, 0.4, 4.5),
    cone().fan(),
    cone(),
    cone(curved=True),
    VECTORS,
]


@pytest.mark.parametrize("scan", SCANS, ids=lambda scan: type(scan).__name__)
def test_some_views_of_a_scan_are_a_scan(scan):
    part = scan.subset([4, 1])
    assert part.views == 2 and part != scan
    assert scan.subset(np.arange(7)) == scan == scan.subset(np.ones(7, bool))
    for name in ("angles", "source", "heights"):
        if hasattr(scan, name):
            assert getattr(part, name).tolist() == getattr(scan, name)[[4, 1]].tolist()


@pytest.mark.parametrize("scan", SCANS, ids=lambda scan: type(scan).__name__)
def test_another_unit_changes_every_length_and_no_angle(scan):
    scaled = scan.scaled(10.0)
    if isinstance(scan, rift.Vectors):
        np.testing.assert_allclose(scaled.corners(), 10 * np.array(scan.corners()))
    else:
        assert np.allclose(scaled.pitch, 10 * np.array(scan.pitch))
        assert scaled.angles.tolist() == scan.angles.tolist()
        assert scaled.center == scan.center and scaled.bins == scan.bins
    if isinstance(scan, rift.Cone) and not scan.curved:
        assert rift.Cone.of_vectors(scaled.vectors()).pitch == pytest.approx((5.0, 4.0))
    with pytest.raises(InputError, match="factor"):
        scan.scaled(-1)
