"""What merits refuse: each in one sentence that names what came and what was wanted."""

import numpy as np
import pytest
from scattered_cameras import cameras

from rift_cl.errors import InputError, NonFiniteError, RiftError, ShapeError
from rift_cl.sampling.criteria.exact import exact
from rift_cl.sampling.criteria.merit import criterion_of_coverage, merit
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import PowerLaw
from rift_cl.sampling.targets.target import Target, half_ball

KINDS = ("wiener", "logdet", "worst")


@pytest.fixture(scope="module")
def target():
    return Target((0, 0, 0), 1.0, snr=300.0, frequencies=half_ball(16.0, 200))


class Odd:
    def __init__(self, value):
        self.value = value

    def power(self, k, diameter):
        return np.full(len(k), self.value)


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda t: merit(cameras(2), t, "best"), InputError, "kind is 'best'"),
        (lambda t: criterion_of_coverage("exact", t.k.T[2:], t), InputError, "kind is 'exact'"),
        (lambda t: merit([], t), ShapeError, "cameras is empty"),
        (lambda t: merit(cameras(1)[0], t), InputError, "cameras in a sequence"),
        (lambda t: merit(Observations.along([[0, 0, 1]]), t), InputError, "this is a Observations"),
        (
            lambda t: exact(Observations.along([[0, 0, 1]] * 3), Target((0, 0, 0), 1.0, snr=1e30)),
            InputError,
            "take a lower snr",
        ),
        (lambda t: merit(cameras(2), t, weights=[1.0]), ShapeError, r"weights has shape \(1,\)"),
        (lambda t: merit(cameras(2), t, weights=[1, -1]), InputError, "0 or more"),
        (lambda t: merit(cameras(2), t, weights=[1, np.nan]), InputError, "NaN"),
        (lambda t: criterion_of_coverage("wiener", [[1.0]], t), ShapeError, "coverage has shape"),
        (lambda t: criterion_of_coverage("wiener", -t.k.T[2:], t), InputError, "goes down to -"),
        (lambda t: criterion_of_coverage("worst", t.k.T[2:] + np.nan, t), NonFiniteError, "NaN"),
        (lambda t: exact(Observations.along([[1, 0, 0]]), t, 99), RiftError, "99 samples across"),
        (
            lambda t: exact(Observations.along([[0, 0, 1]]), Target.flat(1.0)),
            InputError,
            "target is flat",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(call, error, says, target):
    with pytest.raises(error, match=says):
        call(target)


@pytest.mark.parametrize(
    ("value", "error"), [(-1.0, InputError), (np.nan, NonFiniteError), (0.0, InputError)]
)
def test_a_prior_without_sense_is_refused(value, error):
    for kind in (*KINDS, "kriging", "exact"):
        with pytest.raises(error, match="prior gives"):
            merit(cameras(2), Target((0, 0, 0), 1.0, prior=Odd(value)), kind)


def test_a_signal_without_strength_is_refused():
    for snr in (0, -3, np.nan):
        with pytest.raises(InputError, match="snr is"):
            Target((0, 0, 0), 1.0, snr=snr, prior=PowerLaw(2))
