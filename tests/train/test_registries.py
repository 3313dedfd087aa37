"""Strategies and losses of one's own: known by a name, refused where they cannot serve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rift_cl.basis.angular import (
    ANGULAR_BASES,
    SphericalGaussians,
    angular_basis,
    register_angular_basis,
)
from rift_cl.basis.angular.own_basis import check_own_basis
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.run_folder.saved_settings import parsed_settings
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.geometry import Camera
from rift_cl.registry import Registry
from rift_cl.train import (
    PIXEL_LOSSES,
    STRATEGIES,
    ImageLoss,
    ImageViews,
    McmcSettings,
    Parameters,
    PixelLoss,
    Strategy,
    StrategySettings,
    Trainer,
    TrainSettings,
    register_loss,
    register_strategy,
    start_splats,
)
from rift_cl.train.loss.own_loss import check_own_loss

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
    numbers.add("two", 22, replace=True)
    assert numbers["two"] == 22 and "one, two" in repr(numbers)
    numbers.add("two", 2, replace=True)
    with pytest.raises(InputError, match="'one' is the package's own"):
        numbers.add("one", 3, replace=True)
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


WRONG_LOSSES = {
    "wrongsign": (PixelLoss("d * d", "-2 * d * m"), "the gradient is .* and the slope"),
    "nothing": (PixelLoss("1.0f", "0.0f"), "0 everywhere"),
    "root": (PixelLoss("sqrt(d)", "0.5f * m / sqrt(d)"), "wanted finite numbers"),
    "flat": (PixelLoss("sqrt(d * d)", "m * d / sqrt(d * d)"), "at d = 0 .* wanted finite numbers"),
    "halves": (PixelLoss("fabs(d)", "m * (d > 0 ? 1 : -1)"), "does not compile; d and m are vec"),
    "open": (PixelLoss("sqrt(d * d", "d"), "does not compile: .*expected"),
    "falling": (PixelLoss("1 - d * d", "-2 * d * m"), "falls as images differ more"),
    "away": (PixelLoss("d * d", "-2 * d * m", surrogate=True), "falls as images differ more"),
}


@pytest.mark.parametrize("name", WRONG_LOSSES)
def test_a_loss_that_is_wrong_is_refused_before_a_fit(device, name):
    if name == "halves" and device.traits.macros["LANES"] == 1:
        pytest.skip("compiles where d is a number")
    loss, said = WRONG_LOSSES[name]
    register_loss(name, loss)
    try:
        with pytest.raises(InputError, match=f"pixel loss '{name}'.*{said}"):
            check_own_loss(device, name)
    finally:
        PIXEL_LOSSES.remove(name)


@pytest.mark.parametrize(
    "loss",
    [
        PixelLoss("sqrt(d * d + 1e-4f)", "m * d / sqrt(d * d + 1e-4f)"),
        PixelLoss("fabs(d) < 0.1f ? 5 * d * d : fabs(d) - 0.05f",
                  "m * (fabs(d) < 0.1f ? 10 * d : sign(d))"),
        PixelLoss("d > 0 ? 3 * d : -d", "d > 0 ? 3 * m : -m"),
        PixelLoss("d * d", "d > 0 ? m : -m", surrogate=True),
        PixelLoss("1 + d * d - -1.0f", "2 * d * m - - d * 0.0f + + d * 0.0f"),
    ],
)  # fmt: skip
def test_losses_that_are_right_or_meant_so_pass(device, loss):
    register_loss("right", loss)
    try:
        check_own_loss(device, "right")
    finally:
        PIXEL_LOSSES.remove("right")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: s._replace(values=s.values[..., :-1]), r"values of .* has shape \(24, 3\)"),
        (lambda s: s._replace(values=np.nan * s.values), "values holds NaN"),
        (lambda s: s._replace(values=s.values * [1, 1, 0, 1]), "function 2 is 0 everywhere"),
        (lambda s: s._replace(values=s.values[:, [0, 1, 2, 1]]), "functions 1 and 3 are the same"),
        (lambda s: s._replace(values=2 * s.values), "wanted the constant"),
        (lambda s: s._replace(by_geometry=-s.by_geometry), r"by_geometry\[..., 0\] is"),
        (lambda s: s._replace(by_directions=0 * s.by_directions), r"by_directions\[..., 0\] is"),
        (tuple, "gives tuple, wanted Slopes"),
    ],
)
def test_a_basis_that_is_wrong_is_refused_before_a_fit(monkeypatch, change, said):
    class Wrong(SphericalGaussians):
        def slopes(self, geometry, directions):
            return change(super().slopes(geometry, directions))

    register_angular_basis("wrong", lambda count: Wrong(count - 1))
    try:
        with pytest.raises(InputError, match=f"angular basis 'wrong'.*{said}"):
            angular_basis("wrong", 4)
    finally:
        ANGULAR_BASES.remove("wrong")


@pytest.mark.parametrize(
    "kept",
    [lambda values: values.astype("f4"), lambda values: values.astype("f4").astype("f8")],
    ids=["float32", "computed in float32"],
)
def test_a_basis_in_float32_is_taken_if_it_is_right(kept):
    class Single(SphericalGaussians):
        sign = 1

        def slopes(self, geometry, directions):
            right = super().slopes(geometry, directions)
            return right._replace(
                values=kept(right.values), by_geometry=kept(self.sign * right.by_geometry)
            )

    check_own_basis("single", Single(3), 4)
    Single.sign = 1.1
    with pytest.raises(InputError, match="the derivative is not that of the function"):
        check_own_basis("single", Single(3), 4)


def test_a_fit_that_diverges_stops_where_it_is_seen(device, monkeypatch):
    camera = Camera((16, 16), [[16, 0, 8], [0, 16, 8], [0, 0, 1]], np.eye(4))
    views = ImageViews(device, [camera], [np.zeros((16, 16, 3), np.float32)])
    splats = Parameters.of(device, start_splats(np.array([[0, 0, 3.0], [0, 1, 3.0]])))
    trainer = Trainer(views, splats, TrainSettings(steps=60, splats=2))
    real = trainer._step
    monkeypatch.setattr(trainer, "_step", lambda: real() * np.float32(np.nan))
    with pytest.raises(NonFiniteError, match="after step 25: the fit has diverged"):
        list(trainer.run())


def test_splats_that_are_lost_to_nan_are_told_of(device):
    """No image shows them, so that no loss tells of them."""
    trainer = _trainer(device, Still())
    broken = trainer.state()["raw.means"]
    broken[7, 1] = np.nan
    trainer.parameters.raw["means"].set(broken)
    with pytest.warns(UserWarning, match="1 of 20 splats hold NaN or infinity after the last"):
        list(trainer.run())


def test_a_mask_of_whole_numbers_is_not_read_as_indices(device):
    splats = Parameters.of(device, start_splats(np.eye(3)))
    assert len(splats.selected(np.array([True, False, True]))) == 2
    assert len(splats.selected(np.array([2, 0, 1]))) == 3
    with pytest.raises(InputError, match="mask of whole numbers"):
        splats.selected(np.array([1, 0, 1]))


def test_lists_and_whatever_becomes_an_array_select_splats(device):
    splats = Parameters.of(device, start_splats(np.eye(3)))
    assert len(splats.selected([True, False, True])) == 2
    assert len(splats.selected((2, 0, 1))) == 3
    with pytest.raises(InputError, match=r"on the device: give .*device\.get\(rows\)"):
        splats.selected(splats.drawn.opacities)
    with pytest.raises(InputError, match=r"Parameters.selected: rows"):
        splats.selected(None)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (np.ones(2, bool), r"bool and shape \(2,\)"),
        (np.ones((3, 1), bool), r"shape \(3, 1\)"),
        (np.ones(3), "float64"),
        (np.array([0, 3]), "from 0 to 3"),
        (np.array([-4]), "from -4"),
    ],
)
def test_rows_that_select_no_splats_are_refused(device, rows, said):
    splats = Parameters.of(device, start_splats(np.eye(3)))
    with pytest.raises(InputError, match=f"Parameters.selected: .*{said}"):
        splats.selected(rows)


def _trainer(device, settings):
    view = np.eye(4)
    view[2, 3] = 4
    cameras = [Camera((16, 16), [[16, 0, 8], [0, 16, 8], [0, 0, 1]], view)]
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    splats = Parameters.of(device, start_splats(points))
    pictures = ImageViews(device, cameras, [np.ones((16, 16, 3))])
    return Trainer(pictures, splats, TrainSettings(steps=2, splats=30, strategy=settings))


@dataclass(frozen=True)
class Forgetful(StrategySettings):
    """Begins with whatever is asked for."""

    made: str = "nothing"

    def begin(self, parameters, run):
        class Runless(Strategy):
            def __init__(self, run):
                pass

        class Lost(Strategy):
            def after_step(self, parameters, frame, gradients, learning_rate):
                pass

        class Growing(Strategy):
            def after_step(self, parameters, frame, gradients, learning_rate):
                return parameters.selected(np.arange(2 * len(parameters)) // 2)

        class Anew(Strategy):
            def after_step(self, parameters, frame, gradients, learning_rate):
                return Parameters.of(parameters.device, start_splats(np.eye(3)))

        kinds = {"runless": Runless, "lost": Lost, "growing": Growing, "anew": Anew}
        return kinds[self.made](run) if self.made in kinds else None


@pytest.mark.parametrize(
    ("made", "said"),
    [
        ("nothing", r"Forgetful\.begin: gave None, wanted a Strategy"),
        ("runless", r"Forgetful\.begin: .* super\(\).__init__\(run\)"),
        ("lost", r"Lost\.after_step: gave None, wanted the Parameters"),
        ("anew", r"step 1: Anew\.after_step gave Parameters of step 0.*step=parameters\.step"),
        ("growing", r"step 1: Growing made 40 splats of 20, wanted at most 30"),
    ],
)
def test_a_strategy_that_gives_nothing_is_named(device, made, said):
    with pytest.raises(InputError, match=said):
        for _ in _trainer(device, Forgetful(made)).run():
            pass


def test_a_misspelt_hook_and_a_setting_without_a_default_are_refused():
    with pytest.raises(InputError, match=r"after_steps: .* did you mean after_step\?"):

        class Deaf(Strategy):
            def after_steps(self, parameters, frame, gradients, learning_rate):
                return parameters

    @dataclass(frozen=True)
    class Wanting(Still):
        every: int

    with pytest.raises(InputError, match=r"Wanting\.every has no default"):
        register_strategy("wanting", Wanting)
