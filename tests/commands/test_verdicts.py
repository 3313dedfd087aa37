"""Verdicts on opaque targets: what they foretell of a view; those that failed are not said."""

from __future__ import annotations

import math

import numpy as np
from walls import arc, looking

from rift_cl.commands.analyze.verdicts import HELD, foretold, said
from rift_cl.commands.inputs.surfaces import sides_of
from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.sampling.targets.target import Target


def views(cameras):
    target = Target((0, 0, 0), 1.2)
    return ViewSet("arc", target, np.array([0.0, 0, 1]), "unit", tuple(cameras), opaque=True)


def at(degrees, distance=4.0):
    turn = math.radians(degrees)
    return looking((distance * math.cos(turn), distance * math.sin(turn), 1.0))


def test_a_view_farther_from_those_taken_is_foretold_worse():
    found = foretold(views(arc(7, 30)), [at(2), at(40), at(70), at(120)])
    for name in ("angle", "appearance", "sides"):
        assert (np.diff(found[name]) > 0).all(), name
    # To the camera at 30 degrees, all of them 14 above the horizon.
    lift = math.atan(0.25)
    turn = math.radians(40)
    cosine = math.cos(turn) * math.cos(lift) ** 2 + math.sin(lift) ** 2
    np.testing.assert_allclose(found["angle"][2], math.acos(cosine), rtol=1e-6)
    near = foretold(views(arc(7, 30)), [at(0), at(0, 2.0)])["pixel"]
    assert near[1] > 1.5 * near[0]


def test_the_largest_gap_of_an_arc_lies_behind_it():
    sides = sides_of(views(arc(7, 30)), 4.0)
    assert 130 < sides.gap <= 180
    assert sides.farthest[0] < -0.8


def test_what_did_not_hold_is_withheld():
    every = {name: name for name in ("angle", "appearance", "sides", "pixel", "parallax")}
    assert said(every) == list(HELD) == ["angle", "pixel"]
