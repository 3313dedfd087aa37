"""Densities by least squares: known ones are found, nothing gets worse, and runs stay the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rift_cl.basis.indices import graded
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.jobs.xray_input import Projections, XrayPictures
from rift_cl.splat.orders import count_of
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.additive import Additive
from rift_cl.train.basis_settings import BasisSettings
from rift_cl.train.density_solve import DensityProblem, solve_densities
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.solve_settings import SolveSettings
from rift_cl.train.start import start_splats
from rift_cl.train.trainer import Trainer
from rift_cl.train.xray_trainer import XrayTrainer, xray_settings

SIZE, COUNT = 20, 6
DRAWING = SplatSettings(mode="xray")
EXACT = SolveSettings(every=1, iterations=40, ridge=1e-7)
STEPS = 24


def projections(views, rows, values=None):
    angles = np.arange(views) * np.pi / views
    if values is None:
        values = np.zeros((views, rows, SIZE), np.float32)
    return Projections(angles, values, (SIZE - 1) / 2, 1.0)


def cameras_of(views, rows):
    return projections(views, rows).cameras()


def scene(order, seed=0, flat=False):
    """Raw values of splats that do not lie on one another, in a ball before any view."""
    random = np.random.default_rng(seed)
    places = ([-7, 0, 7], [-5, 5], [0]) if flat else ([-5, 5], [-5, 5], [-5, 5])
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 3)
    means = grid[:COUNT] + random.uniform(-1, 1, (COUNT, 3)) * (1, 1, not flat)
    raw = start_splats(means, np.ones((COUNT, 3)), seed=seed)
    raw["log_scales"] = np.log(random.uniform(1, 2, (COUNT, 3))).astype(np.float32)
    raw["logits"] = np.log(random.uniform(0.1, 0.5, COUNT)).astype(np.float32)
    if order:
        modes = 0.2 * random.normal(size=(COUNT, count_of(order) - 1))
        raw["shape_modes"] = modes.astype(np.float32)
    return raw


def pictures_of(device, raw, views=5, rows=SIZE):
    """What a scan would measure of a scene."""
    splats = Parameters.of(device, raw, density=True).drawn
    renderer = Renderer(DRAWING, device=device)
    drawn = [device.get(renderer.forward(splats, k).image) for k in cameras_of(views, rows)]
    return XrayPictures(device, projections(views, rows, np.stack(drawn)[..., 0]))


def solved(device, raw, pictures, settings=EXACT, band=None, **more):
    parameters = Parameters.of(device, raw, density=True, band=band)
    for name, value in more.items():
        setattr(parameters, name, value)
    solve_densities(parameters, Renderer(DRAWING, device=device), pictures, settings, seed=3)
    return parameters


def forgotten(raw, seed=5):
    """The same places with other densities and no modes."""
    random = np.random.default_rng(seed)
    other = dict(raw, logits=np.log(random.uniform(0.05, 1, COUNT)).astype(np.float32))
    return other | {name: 0 * raw[name] for name in ("shape_modes",) if name in raw}


@pytest.mark.parametrize("order", [0, 1, 2])
def test_known_densities_and_modes_are_found_where_splats_are_known(device, order):
    raw = scene(order)
    found = solved(device, forgotten(raw), pictures_of(device, raw)).host()[0]
    np.testing.assert_allclose(np.exp(found["logits"]), np.exp(raw["logits"]), rtol=1e-3)
    if order:
        np.testing.assert_allclose(found["shape_modes"], raw["shape_modes"], atol=1e-3)
    for name in ("means", "quats", "log_scales", "sh"):
        assert found[name].tobytes() == raw[name].tobytes()


def test_a_band_that_widens_splats_is_heeded(device):
    raw = scene(1)
    band = np.full(COUNT, 0.8, np.float32)
    true = Parameters.of(device, raw, density=True, band=band)
    renderer = Renderer(DRAWING, device=device)
    drawn = [device.get(renderer.forward(true.drawn, k).image) for k in cameras_of(5, SIZE)]
    pictures = XrayPictures(device, projections(5, SIZE, np.stack(drawn)[..., 0]))
    found = solved(device, forgotten(raw), pictures, band=band)
    np.testing.assert_allclose(found.host()[0]["logits"], raw["logits"], atol=1e-3)
    drawn_density = device.get(found.drawn.opacities)
    np.testing.assert_allclose(drawn_density, device.get(true.drawn.opacities), rtol=1e-3)


def problem_of(device, targets, *, least, ridge, weights=None):
    parameters = Parameters.of(device, scene(1), density=True)
    renderer = Renderer(DRAWING, device=device)
    operator = Additive(renderer, cameras_of(4, SIZE), parameters.drawn, modes=4)
    weights = np.ones(targets.shape) if weights is None else weights
    free = np.ones(operator.shape, bool)
    return DensityProblem(operator, targets, weights, free, ridge=ridge, least=least)


@pytest.mark.parametrize("iterations", [1, 2, 9])
@pytest.mark.parametrize("ridge", [1e-4, 1e3])
@pytest.mark.parametrize("wanted", ["noise", "nothing", "less than nothing"])
def test_no_solve_raises_the_loss_or_goes_below_the_least(device, iterations, ridge, wanted):
    random = np.random.default_rng(iterations)
    targets = random.normal(size=(4, SIZE, SIZE, 1))
    targets = {"noise": targets, "nothing": 0 * targets, "less than nothing": -abs(targets)}[wanted]
    problem = problem_of(device, targets, least=0.01, ridge=ridge)
    start = np.abs(random.normal(size=problem.operator.shape)) + 0.02
    found = problem.solved(start, iterations)
    assert problem.loss(found) < problem.loss(start)
    assert found[:, 0].min() >= 0.01
    held = found[:, 0, 0] == 0.01
    assert not found[held, 1:].any()
    # Once more from there, where hardly anything is left to gain.
    assert problem.loss(problem.solved(found, iterations)) <= problem.loss(found)


def test_pixels_that_do_not_count_say_nothing(device):
    raw, random = scene(1), np.random.default_rng(0)
    pictures = pictures_of(device, raw)
    there = (random.random((SIZE, SIZE)) < 0.8).astype(np.float32)
    spoilt = np.where(there > 0, pictures.projections.values, 1e3).astype(np.float32)
    pictures = XrayPictures(device, replace(pictures.projections, values=spoilt))
    pictures.weights = lambda number: device.array(there)
    found = solved(device, forgotten(raw), pictures).host()[0]
    np.testing.assert_allclose(np.exp(found["logits"]), np.exp(raw["logits"]), rtol=2e-3)
    np.testing.assert_allclose(found["shape_modes"], raw["shape_modes"], atol=2e-3)


def test_modes_that_are_held_stay_at_zero(device):
    raw = scene(2, flat=True)
    across = graded(2, 3)[1:, 2] > 0
    raw["shape_modes"][:, across] = 0
    free = np.broadcast_to(~across, raw["shape_modes"].shape).astype(np.float32)
    pictures = pictures_of(device, raw, views=11, rows=1)
    found = solved(
        device, forgotten(raw), pictures, free={"shape_modes": device.array(free)}
    ).host()[0]
    assert not found["shape_modes"][:, across].any()
    np.testing.assert_allclose(np.exp(found["logits"]), np.exp(raw["logits"]), rtol=2e-3)
    np.testing.assert_allclose(found["shape_modes"], raw["shape_modes"], atol=5e-3)


def test_a_draw_of_views_hangs_on_seed_and_step_alone(device):
    raw = scene(0)
    pictures, looked = pictures_of(device, scene(0, seed=1)), []
    target = pictures.target
    pictures.target = lambda number: looked.append(number) or target(number)
    few = replace(EXACT, views=3, iterations=2)
    for step in (0, 0, 1):
        solved(device, raw, pictures, few, step=step)
    assert looked[:3] == looked[3:6] == sorted(set(looked[:3])) != looked[6:]


def test_adam_forgets_what_it_knew_of_densities(device):
    raw, ones = scene(1), {name: np.ones_like(array) for name, array in scene(1).items()}
    parameters = Parameters.of(device, raw, first=ones, second=ones, density=True)
    solve_densities(
        parameters, Renderer(DRAWING, device=device), pictures_of(device, raw), EXACT, seed=0
    )
    for moments in parameters.host()[1:]:
        assert not moments["logits"].any() and not moments["shape_modes"].any()
        assert moments["means"].all() and moments["log_scales"].all()


def test_splats_that_no_view_sees_and_hardly_dense_ones_do_no_harm(device):
    raw = scene(1)
    pictures = pictures_of(device, raw)
    raw["means"][0] = 500
    raw["logits"][1] = -90
    found = solved(device, raw, pictures, replace(EXACT, iterations=4)).host()[0]
    assert all(np.isfinite(array).all() for array in found.values())
    spoilt = pictures.projections.values.copy()
    spoilt[2, 3, 4] = np.nan
    pictures = XrayPictures(device, replace(pictures.projections, values=spoilt))
    with pytest.raises(NonFiniteError, match="solve: targets"):
        solved(device, raw, pictures)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"every": -1}, "SolveSettings: every is -1, wanted a whole number >= 0"),
        ({"every": 2.5}, "every is 2.5"),
        ({"views": 0}, "views is 0, wanted a whole number >= 1"),
        ({"iterations": 0}, "iterations is 0"),
        ({"ridge": -1e-3}, "ridge is -0.001, wanted a number >= 0"),
        ({"ridge": float("nan")}, "ridge is nan"),
    ],
)
def test_bad_settings_are_refused_by_name(given, words):
    with pytest.raises(InputError, match=words):
        SolveSettings(**given)


def test_splats_that_hide_one_another_are_not_solved_for(device):
    pictures = pictures_of(device, scene(0))
    settings = replace(TrainSettings(steps=5), solve=SolveSettings(2))
    with pytest.raises(
        InputError, match=r"solve\.every is 2, which is for the densities of X-rays"
    ):
        Trainer(pictures, Parameters.of(device, scene(0)), settings)


def trainer_of(device, pictures, *, rows, every=5):
    random = np.random.default_rng(2)
    means = random.uniform(-8, 8, (30, 3)) * (1, 1, rows > 1)
    raw = start_splats(means, np.ones((30, 3)), seed=1)
    raw["logits"] -= 2
    settings = xray_settings(
        steps=STEPS,
        seed=4,
        splats=30,
        exponent=0.0,
        basis=BasisSettings("hermite", 2, first=0.2, every=0.2),
        solve=SolveSettings(every, views=4),
    )
    # Renewed between solves and just before one.
    renewal = replace(settings.renewal, first=4, every=6, faint=0.5)
    return XrayTrainer(
        pictures,
        Parameters.of(device, raw, density=True),
        replace(settings, renewal=renewal),
        DRAWING,
        flat=rows == 1,
    )


def run_to(trainer, step):
    while trainer.parameters.step < step:
        trainer.step()


@pytest.mark.parametrize("rows", [1, SIZE])
def test_a_fit_goes_on_from_any_state_to_the_same_bits(device, rows):
    pictures = pictures_of(device, scene(0, flat=rows == 1), rows=rows)
    whole, states = trainer_of(device, pictures, rows=rows), []
    for step in (0, 5, 8):
        run_to(whole, step)
        states.append(whole.state())
    run_to(whole, STEPS)
    for state in states:
        again = trainer_of(device, pictures, rows=rows)
        again.restore(state)
        run_to(again, STEPS)
        for one, other in zip(whole.parameters.host(), again.parameters.host(), strict=True):
            assert all(one[name].tobytes() == other[name].tobytes() for name in one)
    raw = whole.parameters.host()[0]
    assert all(np.isfinite(array).all() for array in raw.values())
    modes, across = raw["shape_modes"], graded(2, 3)[1:, 2] > 0
    assert modes[:, ~across].any() and modes[:, across].any() == (rows > 1)


def test_between_solves_densities_stay_and_the_last_one_ends_the_fit(device):
    pictures = pictures_of(device, scene(0))
    trainer = trainer_of(device, pictures, rows=SIZE, every=10)
    trainer.settings = replace(
        trainer.settings, renewal=replace(trainer.settings.renewal, first=STEPS)
    )
    trainer.strategy.settings = trainer.settings

    def densities():
        return trainer.parameters.host()[0]["logits"].copy()

    found = {0: densities()}
    for step in range(1, STEPS + 1):
        trainer.step()
        found[step] = densities()
    changed = [step for step in range(1, STEPS + 1) if (found[step] != found[step - 1]).any()]
    # Before the steps 0, 10, 20 and after the last.
    assert changed == [1, 11, 21, STEPS]


def test_solves_serve_short_fits(device):
    pictures, losses = pictures_of(device, scene(1), views=9), []
    for every in (0, 6):
        trainer = trainer_of(device, pictures, rows=SIZE, every=every)
        run_to(trainer, STEPS)
        images = [trainer.renderer.forward(trainer.parameters.drawn, k) for k in pictures.cameras]
        drawn = np.stack([device.get(frame.image)[..., 0] for frame in images])
        losses.append(np.square(drawn - pictures.projections.values).mean())
    assert losses[1] < 0.5 * losses[0]


def test_settings_say_what_moves():
    assert xray_settings(steps=9, seed=0, splats=1, exponent=0.0).rates.logits > 0
    solving = xray_settings(steps=9, seed=0, splats=1, exponent=0.0, solve=SolveSettings(3))
    assert solving.rates.logits == solving.rates.shape_modes == 0 < solving.rates.means
    assert TrainSettings().solve == SolveSettings(0)
