"""The directions that a scan lacks are told alike of slices and of fits, and no others are."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.commands.inputs.told_lacks import missing_directions


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
