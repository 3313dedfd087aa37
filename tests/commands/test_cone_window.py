"""A part of a cone's volume is judged by the axis that is found, not by the detector's middle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.reconstruct.cone_input import VolumeWindow
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.errors import InputError
from rift_cl.geometry import Cone

TURN = np.arange(8) * np.pi / 4


def cone(center):
    return Cone(TURN, 6, 44, 1.0, 100.0, 200.0, (2.5, center))


def part(right):
    return ReconstructSettings(scan=Path("scan.npz"), roi=(3, right, 4, 50))


def test_a_part_that_an_axis_off_the_middle_makes_room_for_is_not_refused_early():
    assert VolumeWindow.of(part(60), cone(21.5), settled=False).roi == (3, 60, 4, 50)
    with pytest.raises(InputError, match="lines 0 to 44"):
        VolumeWindow.of(part(60), cone(21.5))
    assert VolumeWindow.of(part(60), cone(9.5)).whole.shape[-1] == 68


def test_a_part_outside_wherever_the_axis_is_is_refused_at_once():
    with pytest.raises(InputError, match="lines 0 to 88"):
        VolumeWindow.of(part(89), cone(21.5), settled=False)
