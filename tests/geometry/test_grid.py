"""Grids: their normal form, what they refuse, and where their samples stand."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rift_cl import Grid
from rift_cl.errors import InputError, RiftError, ShapeError

sizes = st.integers(1, 50)
lengths = st.floats(1e-3, 1e3)
places = st.floats(-1e3, 1e3)


@st.composite
def grids(draw):
    axes = draw(st.sampled_from([2, 3]))
    shape = draw(st.tuples(*[sizes] * axes))
    spacing = draw(lengths | st.tuples(*[lengths] * axes))
    center = draw(places | st.tuples(*[places] * axes))
    return Grid(shape, spacing, center)


@pytest.mark.parametrize(
    "shape", [(4, 6), [4, 6], np.array([4, 6]), (np.int32(4), np.uint8(6)), (4.0, 6.0)]
)
def test_shapes_have_one_form(shape):
    grid = Grid(shape)
    assert grid.shape == (4, 6)
    assert [type(n) for n in grid.shape] == [int, int]
    assert grid == Grid((4, 6))
    assert hash(grid) == hash(Grid((4, 6)))


def test_spacing_and_center_are_kept_for_each_axis():
    grid = Grid((2, 3, 4), 0.5, [1, 2, 3])
    assert grid.spacing == (0.5, 0.5, 0.5)
    assert grid.center == (1.0, 2.0, 3.0)
    assert all(type(v) is float for v in (*grid.spacing, *grid.center))
    assert grid == Grid((2, 3, 4), np.float32(0.5), np.array([1, 2, 3]))
    assert Grid((2, 3), [0.5], [7]) == Grid((2, 3), 0.5, 7)


@pytest.mark.parametrize(
    "shape",
    [
        (),
        (4,),
        (1, 2, 3, 4),
        (0, 4),
        (4, -1),
        (4.5, 4),
        4,
        None,
        "ab",
        (None, 4),
        ("4", "4"),
        (np.nan, 4),
        (np.inf, 4),
        ((1, 2), (3, 4)),
        np.zeros((2, 2)),
        {4: 6},
        (4j, 6),
        (True, None),
    ],
)
def test_bad_shapes_are_refused(shape):
    with pytest.raises(ShapeError, match=r"(?s)Grid: shape is .*\(ny, nx\)"):
        Grid(shape)


@pytest.mark.parametrize("spacing", [0, -1, (1, 0), (1, -1e-9), -0.0])
def test_spacing_must_be_positive(spacing):
    with pytest.raises(InputError, match="must be positive"):
        Grid((4, 6), spacing)


@pytest.mark.parametrize("name", ["spacing", "center"])
@pytest.mark.parametrize("value", [np.nan, np.inf, (1, np.nan), "wide", "2", None, [None, 1], 1j])
def test_values_must_be_finite_numbers(name, value):
    with pytest.raises(InputError, match=f"Grid: {name} is"):
        Grid((4, 6), **{name: value})


@pytest.mark.parametrize("name", ["spacing", "center"])
@pytest.mark.parametrize("value", [(1, 2, 3), (), [[1, 2]], [[1], [2]], [[1, 2], [3]]])
def test_values_must_fit_the_axes(name, value):
    with pytest.raises(InputError, match=f"Grid: {name} is"):
        Grid((4, 6), **{name: value})


def test_errors_are_ours():
    assert issubclass(ShapeError, RiftError)
    with pytest.raises(RiftError):
        Grid((4, 6), 10**400)


@given(grids())
def test_coordinates_lie_symmetrically_about_the_center(grid):
    for axis, n in enumerate(grid.shape):
        x = grid.coordinates(axis)
        assert x.shape == (n,)
        assert x.dtype == np.float64
        size = abs(grid.center[axis]) + n * grid.spacing[axis]
        assert abs(x.mean() - grid.center[axis]) <= 1e-12 * size
        np.testing.assert_allclose(np.diff(x), grid.spacing[axis], atol=1e-12 * size)


def test_coordinates_by_hand():
    assert Grid((4, 3), (2.0, 0.5), (10.0, -1.0)).coordinates(0).tolist() == [7, 9, 11, 13]
    assert Grid((4, 3), (2.0, 0.5), (10.0, -1.0)).coordinates(1).tolist() == [-1.5, -1, -0.5]
    assert Grid((1, 1)).coordinates(0).tolist() == [0]
    assert Grid((2, 5)).coordinates(-1).tolist() == [-2, -1, 0, 1, 2]


@given(grids())
def test_slice_is_the_last_two_axes(grid):
    plane = grid.slice()
    assert plane.shape == grid.shape[-2:]
    assert plane.slice() == plane
    for axis in (-2, -1):
        np.testing.assert_array_equal(plane.coordinates(axis), grid.coordinates(axis))
    assert grid.slices * np.prod(plane.shape) == np.prod(grid.shape)


@given(grids())
def test_equal_grids_hash_equally_and_survive_copies(grid):
    again = Grid(grid.shape, grid.spacing, grid.center)
    assert again == grid
    assert hash(again) == hash(grid)
    assert pickle.loads(pickle.dumps(grid)) == grid
    assert dataclasses.replace(grid, spacing=2.0) == Grid(grid.shape, 2.0, grid.center)


def test_different_grids_differ():
    grids = [Grid((4, 6)), Grid((6, 4)), Grid((1, 4, 6)), Grid((4, 6), 2), Grid((4, 6), 1, 1)]
    assert len(set(grids)) == len(grids)
    assert Grid((4, 6)) != (4, 6)


def test_grid_cannot_be_changed():
    grid = Grid((4, 6))
    for name in ("shape", "spacing", "center"):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(grid, name, (1, 1))
    given = [4, 6]
    grid = Grid(given)
    given[0] = 9
    assert grid.shape == (4, 6)
