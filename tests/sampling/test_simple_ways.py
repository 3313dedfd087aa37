"""Zigzags along the edge of a sector, and quantiles of the root of the power."""

import math

import numpy as np
import pytest

from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.planner import plan
from rift_cl.sampling.planning.simple_ways import edge_ways, quantiles_of_power
from rift_cl.sampling.targets.prior import PowerLaw, Spectrum
from rift_cl.sampling.targets.target import Target, half_ball, half_disc

LEVEL = Constraints(elevation=(0, 0))
SECTOR = Constraints(elevation=(0, math.radians(40)), azimuth=(0, math.radians(60)))


def along_x():
    """A flat spectrum with power along kx, 5 to 1."""
    line = np.arange(-24, 25) / 24
    ky, kx = np.meshgrid(line, line, indexing="ij")
    power = 1 / (0.02 + (5 * ky) ** 2 + kx**2) ** 1.5
    return Target.flat(
        60.0, snr=30.0, prior=Spectrum(power, 8 / 60 / 24), frequencies=half_disc(6 / 60, 300)
    )


def test_quantiles_come_near_the_plan_of_a_known_spectrum():
    found = plan(along_x(), 12, LEVEL)
    merits = {name: baseline.merit for name, baseline in found.baselines.items()}
    assert merits["quantiles"] < 0.9 * merits["fibonacci"]
    # Within 0.3 dB of it.
    assert found.merit <= merits["quantiles"] < 1.07 * found.merit


def test_views_of_a_level_spectrum_are_even_and_its_edge_is_cut():
    even = quantiles_of_power(Target.flat(60.0, prior=PowerLaw(2.0)), LEVEL, 6)
    np.testing.assert_allclose(np.diff(even[:, 0]), math.pi / 6, atol=1e-9)
    part = quantiles_of_power(along_x(), Constraints(elevation=(0, 0), azimuth=(0, 1.0)), 6)
    assert part[:, 0].min() > 0 and part[:, 0].max() < 1
    assert quantiles_of_power(Target((0, 0, 0), 60.0), LEVEL, 6) is None
    above = Constraints(elevation=(0.1, 0.5))
    assert quantiles_of_power(along_x(), above, 6) is None


def test_a_zigzag_along_the_edge_beats_what_was_tried_in_a_sector():
    target = Target((0, 0, 0), 60.0, snr=1000.0, frequencies=half_ball(16 / 60, 600))
    found = plan(target, 24, SECTOR, method="greedy")
    merits = {name: baseline.merit for name, baseline in found.baselines.items()}
    others = min(merits[name] for name in ("ring", "arc", "fibonacci", "random"))
    assert merits["zigzag"] < 0.95 * others


@pytest.mark.parametrize("limits", [SECTOR, Constraints(elevation=(0.2, 1.2))])
def test_ways_keep_to_their_limits_and_are_walked_evenly(limits):
    ways = edge_ways(limits)
    assert any("edge" in name for name, _ in ways) == (not limits.full_circle)
    for _, angles in ways:
        (first, last), (low, high) = limits.azimuth, limits.elevation
        assert angles[:, 0].min() >= first - 1e-9 and angles[:, 0].max() <= last + 1e-9
        assert angles[:, 1].min() == pytest.approx(low) and angles[:, 1].max() <= high + 1e-9
        units = limits.frames(angles)[:, 0]
        steps = np.linalg.norm(np.diff(units, axis=0), axis=1)
        assert steps.max() < 1.05 * np.median(steps)
    assert edge_ways(LEVEL) == []
