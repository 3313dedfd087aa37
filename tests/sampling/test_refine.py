"""The polish goes on past a small step, and more than one start is moved."""

import math

import numpy as np
import pytest

from rift_cl.sampling.planning import planner
from rift_cl.sampling.planning.candidates import spread
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.design_space import DesignSpace, default_types
from rift_cl.sampling.planning.free_layout import FreeLayout
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.refine import refine
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.target import Target, half_ball

TARGET = Target(np.zeros(3), 60.0, snr=1000.0, frequencies=half_ball(16 / 60, 3000))
BAND = Constraints(elevation=(0, math.radians(75)))


@pytest.mark.full
def test_a_small_step_does_not_end_the_polish():
    # The first step of these brings a two-thousandth, eleven more 3 %.
    design = DesignSpace(TARGET, BAND, default_types(TARGET))
    objective = Objective(design)
    table = np.repeat(design.limits[0, :, 0][None], 200, axis=0)
    table[:, :2] = spread(BAND, 200, 0)
    even = ViewTable(np.zeros(200, int), table)
    after = objective.value(refine(objective, FreeLayout(design, even), steps=12))
    assert after < 0.97 * objective.value(even)


def test_the_start_that_is_best_after_its_polish_wins_not_the_best_before(monkeypatch):
    objective = Objective(DesignSpace(TARGET, BAND, default_types(TARGET)))
    table = np.zeros((3, 7))
    starts = {
        name: planner.Baseline(name, (), planner.ViewTable(np.zeros(3, int), table + n), n, n)
        for n, name in enumerate(("first", "second", "hopeless"))
    }
    # What each is worth, by its number, before and after it was moved.
    before, after = {0: 1.0, 1: 1.05, 2: 1.5}, {0: 0.99, 1: 0.9, 2: 0.1}
    moved = []

    def worth(_, view_table):
        number, refined = divmod(float(view_table.table[0, 0]), 1)
        return (after if refined else before)[int(number)]

    def move(_, layout, steps=60):
        moved.append(float(layout.begin.table[0, 0]))
        return planner.ViewTable(layout.begin.kind, layout.begin.table + 0.5)

    monkeypatch.setattr(Objective, "value", worth)
    monkeypatch.setattr(planner, "refine", move)
    monkeypatch.setattr(planner, "parted", lambda design, views, spacing: views)
    chosen = starts.pop("first").view_table
    found = planner._moved(objective, chosen, starts)
    assert float(found.table[0, 0]) == pytest.approx(1.5)
    # The better one is then moved to its end.
    assert moved == [0, 1, 1]
