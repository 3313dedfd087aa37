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
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start.points import start_splats
from rift_cl.train.strategy import McmcSettings, McmcStrategy, TrainingRun
from rift_cl.train.trainer import Trainer

pytestmark = pytest.mark.once


def trained(device, **more):
    """A small fit: its reports, and how many splats each of its steps had."""
    strategy = McmcSettings(first=20, every=10, growth=0.3)
    more = {"sh_degree": 0, **more}
    settings = TrainSettings(steps=120, splats=80, strategy=strategy, **more)
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


@pytest.mark.full
def test_the_numbers_of_splats_are_forecast_to_the_last(device):
    trainer, _, counts = trained(device)
    assert counts[0] == 25 and counts[-1] == 80
    for begin in (0, 19, 20, 33, 60, 119):
        runs = trainer.strategy.forecast(begin, counts[begin])
        told = list(itertools.chain.from_iterable([count] * steps for steps, count in runs))
        assert told == counts[begin:]


@pytest.mark.parametrize("degree", [0, 2])
def test_reports_say_how_much_work_is_done_and_left(device, degree):
    _, reports, counts = trained(device, sh_degree=degree, sh_every=50 / 120)
    work = np.cumsum(
        [
            cost(step, count / 80, min(step // 50, degree), 0.5 + 0.1 * 60)
            for step, count in enumerate(counts)
        ]
    )
    for report in reports:
        assert report.work == pytest.approx((work[report.done - 1], work[-1]))


def cost(step, share, degree, pixels=0.6):
    """Of a step with a share of all splats and harmonics of a degree, as the trainer takes it."""
    return (pixels + share * (1 + [0, 0.5, 0.75, 1.0][degree])) * (1 + 0.75 * np.exp(-step / 60))


@pytest.mark.parametrize("large, shrunk", [(0.5, 60), (0.75, 60), (1.0, 60)])
@pytest.mark.parametrize("pixels", [0.4, 0.6, 0.8])
@pytest.mark.parametrize("first_degree, next_degree", [(0.35, 0.2), (0.5, 0.25), (0.65, 0.3)])
@pytest.mark.parametrize("steps, first", [(900, 4000), (3000, 4000), (3000, 8000), (30_000, 2000)])
def test_the_time_left_is_within_a_quarter_from_a_tenth_of_the_run_on(
    steps, first, first_degree, next_degree, pixels, large, shrunk
):
    """Whatever pixels, splats and harmonics cost; kernels are built, and other programs run."""
    most = 8000
    chain = McmcStrategy(McmcSettings(), TrainingRun(steps, most, 0, 1.0, steps))
    runs = chain.forecast(0, first)
    counts = np.concatenate([np.full(length, count) for length, count in runs])
    degrees = np.minimum(np.arange(steps) // 500, 3)
    harmonics = np.array([0, 1, 1, 1])[degrees] * first_degree
    harmonics = harmonics + np.maximum(degrees - 1, 0) * next_degree
    seconds = pixels + counts / most * (1 + harmonics)
    # Splats are too large at first; a degree that joins has its kernels built.
    seconds *= 1 + large * np.exp(-np.arange(steps) / shrunk)
    seconds[500::500][:3] += 0.01 * seconds.sum() / 3
    # Another program runs for a while.
    seconds[int(0.4 * steps) : int(0.42 * steps)] *= 2
    seconds = np.cumsum(seconds)
    shares = counts / most
    work = np.cumsum([cost(*now) for now in zip(range(steps), shares, degrees, strict=True)])
    clock = [0.0]
    pace, worst = Pace(lambda: clock[0]), 0.0
    for done in range(25, steps, 25):
        clock[0] = seconds[done - 1]
        _, left = pace.after(Report(done, steps, "steps", {}, (work[done - 1], work[-1])))
        if 0.1 * steps <= done <= 0.95 * steps:
            worst = max(worst, abs(left / (seconds[-1] - clock[0]) - 1))
    print(f"{steps} steps from {first} splats: {worst:.1%}")
    assert worst <= 0.25
