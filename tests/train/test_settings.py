"""Settings of a fit: what is out of its range is named, with what came and what was wanted."""

from __future__ import annotations

from dataclasses import fields

import pytest

from rift_cl.errors import InputError
from rift_cl.train.settings import Densification, Rates, Relocation, TrainSettings

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        (Rates, {"means": -1e-4}, "Rates: means is -0.0001, wanted a number >= 0"),
        (Rates, {"means_last": 0}, "means_last is 0, wanted a number above 0, at most 1"),
        (Rates, {"means_last": 1.5}, "means_last is 1.5"),
        (Rates, {"logits": 1e39}, "logits is 1e\\+39"),
        (Rates, {"sh": "fast"}, "sh is 'fast'"),
        (Relocation, {"every": 0}, "Relocation: every is 0, wanted a whole number >= 1"),
        (Relocation, {"every": 2.5}, "every is 2.5"),
        (Relocation, {"first": -1}, "first is -1"),
        (Relocation, {"last": 1.1}, "last is 1.1, wanted 0 to 1"),
        (Relocation, {"growth": -0.1}, "growth is -0.1"),
        (Relocation, {"faint": 2}, "faint is 2"),
        (Densification, {"every": 0}, "Densification: every is 0"),
        (Densification, {"reset_least": 0}, "reset_least is 0"),
        (Densification, {"first": -0.1}, "first is -0.1, wanted 0 to 1"),
        (Densification, {"last": 2}, "last is 2"),
        (Densification, {"gradient": 0}, "gradient is 0, wanted a number > 0"),
        (Densification, {"large_on_screen": -1}, "large_on_screen is -1"),
        (Densification, {"faint": 0}, "faint is 0, wanted a number above 0, at most 0.25"),
        (Densification, {"faint": 0.5}, "faint is 0.5"),
        (Densification, {"small": 0.2}, "small is 0.2 and large is 0.1"),
        (TrainSettings, {"strategy": "best"}, "strategy is 'best', wanted mcmc or default"),
    ],
)
def test_a_number_out_of_its_range_is_named(kind, changes, words):
    with pytest.raises(InputError, match=words):
        kind(**changes)


@pytest.mark.parametrize("kind", [Rates, Relocation, Densification])
@pytest.mark.parametrize("value", [NAN, INF, -INF, "1", [1, 2]])
def test_what_is_no_number_is_refused_everywhere(kind, value):
    for item in fields(kind):
        if item.type != "bool":
            with pytest.raises(InputError, match=f"{item.name} is"):
                kind(**{item.name: value})


def test_zero_switches_off_what_can_be_switched_off():
    groups = ("means", "quats", "log_scales", "logits", "sh", "sh_rest")
    assert Rates(**dict.fromkeys(groups, 0)).sh == 0
    assert Relocation(noise=0, opacity_penalty=0, scale_penalty=0, growth=0).noise == 0
    assert Densification(reset=0, large_on_screen=None).reset == 0


def test_the_threshold_follows_the_kind_of_gradient():
    assert Densification().threshold == 2e-4
    assert Densification(absgrad=True).threshold == 8e-4
    assert Densification(absgrad=True, gradient=5e-4).threshold == 5e-4


def test_markov_chains_are_what_is_usual():
    assert TrainSettings().strategy == "mcmc"
