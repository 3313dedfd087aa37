"""Coincident are parted by a little, the same way each time, and only where there is room."""

import math

import numpy as np
import pytest

from rift_cl.sampling.planning.coincident import parted
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.design_space import (
    AZIMUTH,
    DISTANCE,
    ELEVATION,
    DesignSpace,
    default_types,
)
from rift_cl.sampling.planning.keep_out import Cone, KeepOut
from rift_cl.sampling.planning.refine import permitted
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.target import Target, half_ball

TARGET = Target((0, 0, 0), 10.0, frequencies=half_ball(0.5, 50))
SPACING = 0.4


def views(design, *angles):
    table = np.repeat(design.limits[0, :, 0][None], len(angles), axis=0)
    table[:, [AZIMUTH, ELEVATION]] = angles
    return ViewTable(np.zeros(len(angles), int), table)


def site_of(**limits):
    return DesignSpace(TARGET, Constraints(**limits), default_types(TARGET))


def lines_apart(design, view_table):
    outward = view_table.frames(design)[:, 0]
    cosines = np.abs(outward @ outward.T)[np.triu_indices(len(view_table), 1)]
    return np.arccos(np.clip(cosines, -1, 1)).min()


@pytest.mark.parametrize(
    "angles",
    [
        [(0.3, 0.2), (0.3, 0.2)],
        [(0.3, 0.2), (1.0, 0.5), (0.3, 0.2), (0.3, 0.2), (1.0, 0.5)],
        # Opposite each other, and at the pole under two names.
        [(0.3, 0.2), (0.3 - math.pi, -0.2)],
        [(0.3, math.pi / 2), (2.0, math.pi / 2)],
    ],
)
def test_twins_are_parted_by_a_little_and_always_alike(angles):
    design = site_of()
    given = views(design, *angles)
    found = parted(design, given, SPACING)
    assert lines_apart(design, given) < 1e-6
    assert lines_apart(design, found) > 0.005 * SPACING
    moved = (found.frames(design)[:, 0] * given.frames(design)[:, 0]).sum(1)
    assert math.acos(moved.min()) < 0.1 * SPACING
    np.testing.assert_array_equal(found.table[0], given.table[0])
    np.testing.assert_array_equal(found.table, parted(design, given, SPACING).table)
    assert permitted(design, found)


def test_what_is_apart_stays_as_it_is():
    design = site_of()
    given = views(design, (0.3, 0.2), (0.3, 0.25), (2.0, -0.4))
    assert parted(design, given, SPACING) is given


def test_twins_keep_to_limits_and_out_of_keep_outs():
    limits = {"elevation": (0.1, 0.9), "azimuth": (-1, 1)}
    design = site_of(**limits, keepouts=(KeepOut(Cone((0, 0, 0), (1, 0, 0), 0.3)),))
    for corner in [(-1, 0.1), (1, 0.9), (-1, 0.9), (0.0, 0.3000001)]:
        found = parted(design, views(design, corner, corner, corner), SPACING)
        assert permitted(design, found)
        assert lines_apart(design, found) > 1e-4


def test_twins_with_no_room_stay():
    design = site_of(elevation=(0.2, 0.2), azimuth=(0.5, 0.5))
    given = views(design, (0.5, 0.2), (0.5, 0.2))
    np.testing.assert_array_equal(parted(design, given, SPACING).table, given.table)
    assert given.table[0, DISTANCE] > 0
