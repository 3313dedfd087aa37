"""The tool that checks verdicts: what it makes of a scene whose views hardly differ."""

import math

import numpy as np


def test_a_scene_whose_views_hardly_differ_tells_nothing_of_a_verdict(tool):
    rank = tool("check_verdicts")._rank
    assert math.isnan(rank(np.array([1.0, 1.01, 0.99]), [1.0, 2, 3]))
    assert rank(np.array([1.0, 2, 4]), [1.0, 2, 3]) == 1
    assert rank(np.array([4.0, 2, 1]), [1.0, 2, 3]) == -1
