"""What is said of a beam's geometry."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.geometry import Cone
from rift_cl.io.scans.beam import beam_words


@pytest.mark.parametrize(("rise", "moves"), [(28.0, "rises"), (-28.0, "falls")])
def test_a_helix_says_which_way_its_source_moves(rise, moves):
    angles, heights = np.linspace(0, 12, 40), np.linspace(0, rise, 40)
    cone = Cone(angles, 8, 16, 1.0, 100.0, 200.0, heights=heights)
    assert f"the source {moves} by 28 mm" in beam_words(cone, "mm")
