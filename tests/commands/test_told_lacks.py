"""The directions that a scan lacks are told alike of slices and of fits, and no others are."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.inputs.told_lacks import missing_directions, missing_rays


@pytest.mark.parametrize(
    ("degrees", "told"),
    [
        (np.arange(0, 120, 2), "62 of 180 degrees have no view (118 to 180; limited angle)"),
        (np.r_[20:60, 110:160] + 360, "92 of 180 degrees have no view (59 to 110 and 159 to 200;"),
        (np.r_[0:30:0.5, 30:180:6], ""),
        (np.delete(np.arange(180), range(40, 52)), ""),
        (np.arange(0, 360, 40), ""),
        ([20.0], ""),
    ],
)
def test_holes_are_told_with_their_degrees_and_nothing_else_is(degrees, told):
    (words,) = missing_directions(np.deg2rad(degrees)) or [""]
    assert words[: len(told)] == told and bool(words) == bool(told)


def disc(angles, bins, center, radius):
    """Line integrals of a disc off the axis, in two rows, (angle, row, bin)."""
    away = np.arange(bins) - center - 2 * np.cos(angles)[:, None]
    chords = 2 * np.sqrt(np.maximum(radius**2 - away**2, 0))
    return np.repeat(chords[:, None], 2, axis=1).astype(np.float32)


@pytest.mark.parametrize(
    ("turn", "center", "radius", "side"),
    [
        (np.pi, 15.5, 10, None),
        (np.pi, 15.5, 19, "a side"),
        (2 * np.pi, 8.5, 15, None),
        (2 * np.pi, 8.5, 26, "the farther side"),
    ],
)
def test_a_side_that_the_object_reaches_beyond_is_told(turn, center, radius, side):
    angles = np.arange(40) * turn / 40
    scan = rift.Parallel(angles, 32, center=center)
    told = missing_rays(disc(angles, 32, center, radius), scan)
    assert len(told) == (side is not None)
    assert all(f"beyond {side} of the detector" in words for words in told)
