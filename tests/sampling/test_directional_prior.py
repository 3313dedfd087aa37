"""Priors with directions: measured, blended, blurred, turned; and what a wrong one costs."""

import math

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.planner import plan
from rift_cl.sampling.planning.wrong_prior import if_wrong
from rift_cl.sampling.targets.directional_prior import Trusted, anisotropy, turned
from rift_cl.sampling.targets.pilot import Pilot
from rift_cl.sampling.targets.prior import PowerLaw, Spectrum
from rift_cl.sampling.targets.target import Target, half_ball, half_disc

LEVEL = Constraints(elevation=(0, 0))


def along_x(narrow=0.1):
    """A flat spectrum with power along kx."""
    line = np.arange(-24, 25) / 24
    ky, kx = np.meshgrid(line, line, indexing="ij")
    return Spectrum(np.exp(-((ky / narrow) ** 2) - (kx / 0.6) ** 2), 8 / 60 / 24)


def flat(prior, count=300):
    return Target.flat(60.0, snr=30.0, prior=prior, frequencies=half_disc(6 / 60, count))


def noise(axes, ratio, n):
    """A random object whose power falls with frequency, one axis of which is stretched."""
    k = np.meshgrid(*[np.fft.fftfreq(n)] * axes, indexing="ij")
    square = sum((x * (ratio if axis == 0 else 1)) ** 2 for axis, x in enumerate(k))
    white = np.fft.fftn(np.random.default_rng(0).normal(size=(n,) * axes))
    return np.fft.ifftn(white / np.sqrt(1e-4 + square) ** (axes / 2)).real


@pytest.mark.parametrize(("axes", "n"), [(2, 64), (3, 32)])
def test_a_measured_spectrum_is_anisotropic_if_it_is_and_not_by_its_type(axes, n):
    for ratio, least, most in ((1, 0, 0.2), (2, 0.25, 0.5), (5, 0.5, 1.2)):
        prior = Pilot(noise(axes, ratio, n), 60 / n)
        target = flat(prior) if axes == 2 else Target(np.zeros(3), 60.0, prior=prior)
        assert least <= anisotropy(target) <= most
    assert anisotropy(Target(np.zeros(3), 60.0, prior=PowerLaw(3.0))) == 0


def test_the_verdict_calls_a_round_measured_spectrum_isotropic():
    round_one = plan(flat(along_x(0.6)), 6, LEVEL, method="greedy")
    long_one = plan(flat(along_x()), 6, LEVEL, method="greedy")
    assert "(isotropic target" in round_one.verdict()
    assert "(anisotropic target" in long_one.verdict()
    assert if_wrong(round_one) == ()


def test_trust_blends_with_the_mean_over_directions_and_blur_spreads_them():
    prior, k = along_x(), half_disc(6 / 60, 400)
    whole, none, half = (Trusted(prior, t, axes=2).power(k, 60.0) for t in (1.0, 0.0, 0.5))
    np.testing.assert_allclose(whole, prior.power(k, 60.0))
    np.testing.assert_allclose(half, (whole + none) / 2)
    # What is left has no direction, and the same power on the whole.
    assert anisotropy(flat(Trusted(prior, 0.0, axes=2))) < 1e-6
    assert none.sum() == pytest.approx(whole.sum(), rel=0.05)
    spread = [anisotropy(flat(Trusted(prior, 1.0, b, axes=2))) for b in (0.0, 0.2, 0.5)]
    assert spread[0] > spread[1] > spread[2] > 0
    round_one = Trusted(PowerLaw(2.0), 0.3, 0.4)
    np.testing.assert_allclose(
        round_one.power(half_ball(0.2, 50), 60.0),
        PowerLaw(2.0).power(half_ball(0.2, 50), 60.0),
        rtol=0.05,
    )


def test_a_turned_prior_has_the_power_of_the_turned_frequency():
    prior, k = along_x(), half_disc(6 / 60, 40)
    quarter = turned(prior, (0, 0, 1), math.pi / 2).power(k, 60.0)
    back = np.column_stack([k[:, 1], -k[:, 0], k[:, 2]])
    np.testing.assert_allclose(quarter, prior.power(back, 60.0), atol=1e-12)


@pytest.mark.full
def test_a_plan_says_what_it_loses_if_its_prior_is_wrong_and_a_blend_loses_less():
    sure = plan(flat(along_x()), 12, LEVEL)
    blend = plan(flat(Trusted(along_x(), 0.8, axes=2)), 12, LEVEL)
    half, quarter = if_wrong(sure)
    assert (half.degrees, quarter.degrees) == (45, 90)
    assert quarter.planned > 1.5 * quarter.even
    assert "--prior-trust" in quarter.sentence
    right = flat(along_x())
    wrong = flat(turned(along_x(), (0, 0, 1), math.pi / 2))
    unknown = {
        (name, kind): found.objective.rough._at(target).value(found.view_table)
        for name, found in (("sure", sure), ("blend", blend))
        for kind, target in (("right", right), ("wrong", wrong))
    }
    assert unknown["blend", "wrong"] < 0.75 * unknown["sure", "wrong"]
    assert unknown["blend", "right"] < 1.5 * unknown["sure", "right"]
    # Where nothing has a direction there is nothing to get wrong.
    assert if_wrong(plan(Target.flat(60.0, snr=30.0), 6, LEVEL, method="greedy")) == ()


@pytest.mark.parametrize(("trust", "blur"), [(-0.1, 0), (1.5, 0), (0.5, -1), (math.nan, 0)])
def test_a_trust_that_makes_no_sense_is_refused(trust, blur):
    with pytest.raises(InputError, match="Trusted: "):
        Trusted(PowerLaw(2.0), trust, blur)
