"""Strategies and losses of one's own: known by a name, refused where they cannot serve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.run_folder.saved_settings import parsed_settings
from rift_cl.errors import InputError
from rift_cl.registry import Registry
from rift_cl.train import (
    PIXEL_LOSSES,
    STRATEGIES,
    ImageLoss,
    McmcSettings,
    PixelLoss,
    Strategy,
    StrategySettings,
    TrainSettings,
    register_loss,
    register_strategy,
)

pytestmark = pytest.mark.once


@dataclass(frozen=True)
class Still(StrategySettings):
    """Nothing changes."""

    def begin(self, parameters, run):
        return Strategy(run)


@pytest.fixture
def square():
    register_loss("square", PixelLoss("d * d", "2 * d * m"))
    yield "square"
    PIXEL_LOSSES.remove("square")


def test_a_registry_says_what_it_holds_and_what_is_taken():
    numbers = Registry("number", {"one": 1})
    numbers.add("two", 2)
    assert numbers["two"] == 2 and list(numbers) == ["one", "two"] and len(numbers) == 2
    assert "one" in numbers and "three" not in numbers and numbers.name_of(2) == "two"
    with pytest.raises(InputError, match="'one'"):
        numbers.add("one", 3)
    with pytest.raises(InputError, match="number is 'three'"):
        numbers["three"]
    for name in ("", 3, None):
        with pytest.raises(InputError, match="name of a number"):
            numbers.add(name, 3)
    with pytest.raises(InputError, match="not registered"):
        numbers.name_of(7)


@pytest.mark.parametrize(
    ("job", "settings"), [("fit photos", FitPhotosSettings), ("fit xray", FitXraySettings)]
)
def test_a_loss_of_ones_own_is_an_option_of_both_fits(job, settings, square):
    given = {"capture": "x", "out": "fit"}
    assert parsed_settings({**given, "loss": square}, job, settings).training.loss == square
    with pytest.raises(InputError, match="loss is 'cube'"):
        parsed_settings({**given, "loss": "cube"}, job, settings)


def test_a_loss_of_ones_own_is_the_same_as_the_one_that_it_repeats(device, square):
    random = np.random.default_rng(0)
    image, target = (device.array(random.uniform(size=(20, 17, 3))) for _ in range(2))
    for share in (0.0, 0.3):
        found = ImageLoss(share, square)(device, image, target)
        wanted = ImageLoss(share, "l2")(device, image, target)
        for one, other in zip(found, wanted, strict=True):
            assert device.get(one).tobytes() == device.get(other).tobytes()
    assert TrainSettings(loss=square).loss == square


def test_strategies_are_settings_by_name():
    assert STRATEGIES["mcmc"] is McmcSettings and STRATEGIES.name_of(McmcSettings) == "mcmc"
    register_strategy("still", Still)
    try:
        assert STRATEGIES["still"] is Still and TrainSettings(strategy=Still()).strategy == Still()
    finally:
        STRATEGIES.remove("still")


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: register_strategy("mcmc", Still), "'mcmc'"),
        (lambda: register_strategy("still", Still()), "not a dataclass derived"),
        (lambda: register_strategy("still", Strategy), "not a dataclass derived"),
        (lambda: register_loss("l1", PixelLoss("d", "m")), "'l1'"),
        (lambda: register_loss("mine", "d"), "not a PixelLoss"),
        (lambda: PixelLoss("d", " "), "gradient is"),
        (lambda: ImageLoss(kind="l3"), "'l3'"),
        (lambda: TrainSettings(loss="l3"), "loss is 'l3'"),
        (lambda: TrainSettings(strategy=Still), "strategy is"),
    ],
)
def test_what_cannot_be_used_is_refused(act, words):
    with pytest.raises(InputError, match=words):
        act()
