"""Settings of a fit: what is out of its range is named, with what came and what was wanted."""

from __future__ import annotations

from dataclasses import fields

import pytest

from rift_cl.errors import InputError, SettingError
from rift_cl.train.environment_settings import EnvironmentSettings
from rift_cl.train.schedules import LearningRateSchedule
from rift_cl.train.settings import LearningRates, TrainSettings
from rift_cl.train.strategy import (
    DefaultSettings,
    McmcSettings,
    ResidualSettings,
    XraySettings,
)
from rift_cl.train.surface_settings import SurfaceSettings
from rift_cl.train.xray.settings import XrayTrainSettings

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        (LearningRates, {"means": -1e-4}, r"LearningRates: means is -0.0001"),
        (LearningRates, {"means_last": 0}, "means_last is 0"),
        (LearningRates, {"means_last": 1.5}, "means_last is 1.5"),
        (LearningRates, {"logits": 1e39}, "logits is 1e\\+39"),
        (LearningRates, {"sh": "fast"}, "sh is 'fast'"),
        (McmcSettings, {"every": 0}, "McmcSettings: every is 0"),
        (McmcSettings, {"every": 2.5}, "every is 2.5"),
        (McmcSettings, {"first": -1}, "first is -1"),
        (McmcSettings, {"last": 1.1}, r"last is 1.1"),
        (McmcSettings, {"growth": -0.1}, "growth is -0.1"),
        (McmcSettings, {"min_opacity": 2}, "min_opacity is 2"),
        (ResidualSettings, {"views": 0}, "ResidualSettings: views is 0"),
        (ResidualSettings, {"min_contribution": -1}, "min_contribution is -1"),
        (ResidualSettings, {"every": 0}, "every is 0"),
        (DefaultSettings, {"every": 0}, "DefaultSettings: every is 0"),
        (DefaultSettings, {"min_reset": 0}, "min_reset is 0"),
        (DefaultSettings, {"first": -0.1}, r"first is -0.1"),
        (DefaultSettings, {"last": 2}, "last is 2"),
        (DefaultSettings, {"grow_gradient": 0}, "grow_gradient is 0"),
        (DefaultSettings, {"prune_screen_size": -1}, "prune_screen_size is -1"),
        (
            DefaultSettings,
            {"prune_opacity": 0},
            "prune_opacity is 0",
        ),
        (DefaultSettings, {"prune_opacity": 0.5}, "prune_opacity is 0.5"),
        (DefaultSettings, {"split_scale": 0.2}, "split_scale is 0.2 and prune_scale is 0.1"),
        (TrainSettings, {"strategy": "best"}, "strategy is 'best'"),
    ],
)
def test_a_number_out_of_its_range_is_named(kind, changes, words):
    with pytest.raises(InputError, match=words):
        kind(**changes)


@pytest.mark.parametrize(
    "kind",
    [
        LearningRates,
        ResidualSettings,
        McmcSettings,
        DefaultSettings,
        XraySettings,
        SurfaceSettings,
    ],
)
@pytest.mark.parametrize("value", [NAN, INF, -INF, "1", [1, 2]])
def test_what_is_no_number_is_refused_everywhere(kind, value):
    for item in fields(kind):
        if item.type != "bool":
            with pytest.raises(InputError, match=f"{item.name} is"):
                kind(**{item.name: value})


def test_xrays_have_no_light_to_reflect():
    with pytest.raises(SettingError, match="kind is 'shared'"):
        XrayTrainSettings(environment=EnvironmentSettings("shared"))


def test_xrays_have_no_surfaces():
    with pytest.raises(SettingError, match="surface"):
        XrayTrainSettings(surface=SurfaceSettings(flatness=1.0))


def test_zero_switches_off_what_can_be_switched_off():
    groups = ("means", "quats", "log_scales", "logits", "sh", "sh_rest")
    assert LearningRates(**dict.fromkeys(groups, 0)).sh == 0
    assert McmcSettings(noise=0, opacity_penalty=0, scale_penalty=0, growth=0).noise == 0
    assert DefaultSettings(reset=0, prune_screen_size=None).reset == 0


def test_positions_learn_slower_in_longer_runs():
    rates = LearningRates(means=1e-3, means_steps=500)
    assert rates.first_means(100) == rates.first_means(500) == 1e-3
    # What they add up to does not grow with the steps: that lost fits of 30,000.
    assert rates.first_means(2000) * 2000 == pytest.approx(500 * 1e-3)
    assert LearningRates(means=1e-3, means_steps=0).first_means(30_000) == 1e-3
    for kind, wanted in ((TrainSettings, 6.4e-5), (XrayTrainSettings, 3e-4)):
        first = LearningRateSchedule(kind(steps=30_000), extent=2.0).learning_rates(0)["means"]
        assert first == pytest.approx(2 * wanted)


def test_the_threshold_follows_the_kind_of_gradient():
    assert DefaultSettings().threshold == 2e-4
    assert DefaultSettings(absgrad=True).threshold == 8e-4
    assert DefaultSettings(absgrad=True, grow_gradient=5e-4).threshold == 5e-4


def test_the_default_strategy_goes_by_residuals():
    assert TrainSettings().strategy == ResidualSettings()
