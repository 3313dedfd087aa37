"""The time that is left of a fit: the splats to come are known, and so is what they cost.

Clocks are ours: steps take a time that grows with the number of splats, in several ways.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from test_trainer import Ball

from rift_cl.commands.progress_bar import Pace
from rift_cl.progress import Report
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import Relocation, TrainSettings
from rift_cl.train.start.points import start_splats
from rift_cl.train.strategy.mcmc import McmcStrategy
from rift_cl.train.trainer import Trainer


def trained(device, **more):
    """A small fit: its reports, and how many splats each of its steps had."""
    relocation = Relocation(first=20, every=10, growth=0.3)
    settings = TrainSettings(steps=120, splats=80, sh_degree=0, relocation=relocation, **more)
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (25, 3))
    trainer = Trainer(
        Ball(device),
        Parameters.of(device, start_splats(points, None, seed=0)),
        settings,
        SplatSettings(),
    )
    counts = []
    step = trainer.step

    def counted():
        counts.append(len(trainer.parameters))
        return step()

    trainer.step = counted
    return trainer, list(trainer.run()), counts


def test_the_numbers_of_splats_are_forecast_to_the_last(device):
    trainer, _, counts = trained(device)
    assert counts[0] == 25 and counts[-1] == 80
    for begin in (0, 19, 20, 33, 60, 119):
        runs = trainer.strategy.forecast(begin, counts[begin])
        told = list(itertools.chain.from_iterable([count] * steps for steps, count in runs))
        assert told == counts[begin:]


def test_reports_say_how_much_work_is_done_and_left(device):
    _, reports, counts = trained(device)
    work = np.cumsum([1 + count / 80 for count in counts])
    for report in reports:
        assert report.work == pytest.approx((work[report.done - 1], work[-1]))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("steps, first", [(3000, 4000), (3000, 8000), (30_000, 2000)])
def test_the_time_left_is_within_a_quarter_from_a_tenth_of_the_run_on(steps, first, share):
    """Whatever share of a last step's time is its splats'; the worst is printed."""
    most = 8000
    chain = McmcStrategy(TrainSettings(steps=steps, splats=most), finish=steps)
    runs = chain.forecast(0, first)
    counts = np.concatenate([np.full(length, count) for length, count in runs])
    seconds = np.cumsum(1 - share + share * counts / most)
    work = np.cumsum(1 + counts / most)
    now = [0.0]
    pace, worst = Pace(lambda: now[0]), 0.0
    for done in range(25, steps, 25):
        now[0] = seconds[done - 1]
        _, left = pace.after(Report(done, steps, "steps", {}, (work[done - 1], work[-1])))
        if done >= 0.1 * steps:
            worst = max(worst, abs(left / (seconds[-1] - now[0]) - 1))
    print(f"{steps} steps from {first} splats, share {share:g}: {worst:.1%}")
    # Extremes: splats cost nothing, or nothing else costs anything.
    assert worst <= (0.25 if 0 < share < 1 else 0.3)
