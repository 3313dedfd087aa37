"""Fans of volumes: the cone that they are in its middle, slices that know nothing of each other."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Cone, Fan, Grid, Projector, dot_test
from rift_cl.errors import InputError

ANGLES = np.array([0.1, np.pi / 4, 1.9, 3.2, 4.0, 5.5])
GRID = Grid((11, 30, 26), (2, 1, 1.1))


def fan(**changes):
    return Fan(ANGLES, 40, 1.3, 100, 150, **changes)


def relative(value, truth):
    return np.linalg.norm(value - truth) / np.linalg.norm(truth)


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("power", [1, 2])
def test_the_pair_is_matched_and_slices_are_their_own(device, curved, power):
    A = type(Projector(GRID, fan(), device=device))(
        GRID, fan(curved=curved, center=18.3), device=device, depth_power=power
    )
    assert dot_test(A) <= 1e-7
    x = np.random.default_rng(1).standard_normal(A.domain).astype(np.float32)
    lone = np.zeros_like(x)
    lone[4] = x[4]
    assert np.array_equal(A(lone)[:, 4], A(x)[:, 4])
    assert not np.delete(A(lone), 4, axis=1).any()


@pytest.mark.full
@pytest.mark.parametrize("curved", [False, True])
def test_it_sees_what_a_cone_s_middle_row_and_the_fan_of_one_slice_see(device, curved):
    scan = fan(curved=curved)
    y, x = np.mgrid[:30, :26] - np.array([14.5, 12.5])[:, None, None]
    blob = np.exp(-((x - 2) ** 2 + (y + 3) ** 2) / (2 * 4.0**2))
    volume = np.broadcast_to(blob, GRID.shape)
    seen = Projector(GRID, scan, device=device)(volume)
    cone = Cone(ANGLES, 5, 40, 1.3, 100, 150, curved=curved)
    through = Projector(GRID, cone, device=device)(volume)[:, 2]
    assert relative(seen[:, 3], through) < 8e-3
    one = Projector(GRID.slice(), scan, device=device)(blob)
    assert relative(seen[:, 3], one) < 1e-2


def test_another_power_weighs_by_depth(device):
    kind = type(Projector(GRID, fan(), device=device))
    A, B = (kind(GRID, fan(), device=device, depth_power=power) for power in (1, 2))
    y, x = GRID.coordinates(1)[:, None], GRID.coordinates(2)
    views = np.zeros(A.range)
    views[0] = 1
    depth = 100 - x * np.sin(0.1) + y * np.cos(0.1)
    inside = (slice(None), slice(4, -4), slice(4, -4))
    ratio = B.T(views)[inside] / A.T(views)[inside]
    np.testing.assert_allclose(ratio, np.broadcast_to(100 / depth, GRID.shape)[inside], rtol=2e-2)


def test_other_powers_and_footprints_are_refused(device):
    kind = type(Projector(GRID, fan(), device=device))
    with pytest.raises(InputError, match="depth_power"):
        kind(GRID, fan(), device=device, depth_power=3)
    with pytest.raises(InputError, match="joseph"):
        Projector(GRID, fan(), "joseph", device=device)
