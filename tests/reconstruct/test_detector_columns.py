"""Detector columns on a device: every step equals its twin, to the bit where nothing is summed."""

import numpy as np
import pytest

from rift_cl.reconstruct.preprocess.columns import DetectorColumns
from rift_cl.reference import detector_columns as twin

pytestmark = [pytest.mark.dealt, pytest.mark.variants]

# (view, row, bin): the fewest views; no multiple of any vector, strip or group; a longer column.
SHAPES = [(16, 1, 16), (37, 3, 75), (64, 2, 128), (517, 2, 33)]
every_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)


def values(shape, kind="noise"):
    random = np.random.default_rng(3)
    if kind == "ties":
        found = random.integers(-2, 3, shape) * np.where(random.random(shape) < 0.5, 1.0, -1.0)
    elif kind == "scales":
        found = random.standard_normal(shape) * 10.0 ** random.integers(-30, 30, shape)
    elif kind == "constant":
        found = np.full(shape, -0.7)
    else:
        found = random.standard_normal(shape)
    return found.astype(np.float32)


kinds = pytest.mark.parametrize("kind", ["noise", "ties", "scales", "constant"])


def by_row(step, stack):
    """A twin applied to each row of a stack (view, row, bin)."""
    return np.stack([step(stack[:, row]) for row in range(stack.shape[1])], axis=1)


@every_shape
def test_columns_come_back_as_the_projections_they_were(device, shape):
    x = values(shape)
    np.testing.assert_array_equal(DetectorColumns(device, x).projections(), x)


@kinds
@every_shape
def test_sorting_ranks_and_unsorting_restores(device, shape, kind):
    x = values(shape, kind)
    columns = DetectorColumns(device, x)
    columns.sort()
    np.testing.assert_array_equal(columns.projections(), by_row(lambda y: twin.ranked(y)[0], x))
    order = device.get(columns._order).transpose(2, 0, 1)
    np.testing.assert_array_equal(order, by_row(lambda y: twin.ranked(y)[1], x))
    columns.unsort()
    np.testing.assert_array_equal(columns.projections(), x)


@pytest.mark.parametrize("window", [3, 11, 127])
@every_shape
def test_the_median_across_bins_equals_its_twin(device, shape, window):
    x = values(shape)
    columns = DetectorColumns(device, x)
    columns.median(window)
    expected = by_row(lambda y: twin.median_across(y, window), x)
    np.testing.assert_array_equal(columns.projections(), expected)


@every_shape
def test_profiles_equal_their_twins(device, shape):
    x = values(shape)
    columns, close = DetectorColumns(device, x), {"rtol": 1e-5, "atol": 1e-6}
    rough = by_row(lambda y: twin.roughness(y)[None], x)[0]
    np.testing.assert_allclose(columns.roughness(), rough, **close)
    for dropped in (0, 3):
        expected = by_row(lambda y, d=dropped: twin.level(y, d)[None], x)[0]
        np.testing.assert_allclose(columns.levels(dropped), expected, **close)


@every_shape
def test_bad_columns_are_filled_from_good_ones_of_their_row(device, shape):
    x = values(shape)
    bad = np.zeros(shape[1:], np.bool_)
    for row in range(shape[1]):
        bad[row, 3 + row : 6 + row] = bad[row, 9 + row] = True
    columns = DetectorColumns(device, x)
    columns.interpolate(bad)
    expected = np.stack([twin.blended(x[:, r], bad[r]) for r in range(shape[1])], axis=1)
    np.testing.assert_array_equal(columns.projections(), expected)


def test_nothing_bad_changes_nothing(device):
    x = values((16, 2, 16))
    columns = DetectorColumns(device, x)
    columns.interpolate(np.zeros((2, 16), np.bool_))
    np.testing.assert_array_equal(columns.projections(), x)


@every_shape
def test_a_number_is_subtracted_from_each_column(device, shape):
    x, shift = values(shape), values(shape[1:], "ties")
    columns = DetectorColumns(device, x)
    columns.subtract(shift)
    np.testing.assert_array_equal(columns.projections(), x - shift)
