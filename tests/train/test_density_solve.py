"""Densities by least squares: known ones are found, nothing gets worse, and runs stay the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from density_scenes import COUNT, DRAWING, SIZE, cameras_of, pictures_of, projections, scene

from rift_cl.basis.indices import graded
from rift_cl.commands.fit_xray.input import XrayPictures
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.splat.renderer import Renderer
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.trainer import Trainer
from rift_cl.train.xray.additive import Additive
from rift_cl.train.xray.density_solve import DensityProblem, solve_densities
from rift_cl.train.xray.solve_settings import SolveSettings

pytestmark = pytest.mark.once

EXACT = SolveSettings(every=1, iterations=40, ridge=1e-7)


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


@pytest.mark.full
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


def problem_of(device, targets, *, least, ridge):
    parameters = Parameters.of(device, scene(1), density=True)
    renderer = Renderer(DRAWING, device=device)
    operator = Additive(renderer, cameras_of(4, SIZE), parameters.drawn, modes=4)
    free = np.ones(operator.domain, bool)
    given = operator, device.array(targets, np.float32), operator.energies(), free
    return DensityProblem(*given, ridge=ridge, least=least)


@pytest.mark.parametrize("iterations", [1, 2, 9])
@pytest.mark.parametrize("ridge", [1e-4, 1e3])
@pytest.mark.parametrize("wanted", ["noise", "nothing", "less than nothing"])
def test_no_solve_raises_the_loss_or_goes_below_the_least(device, iterations, ridge, wanted):
    random = np.random.default_rng(iterations)
    targets = random.normal(size=(4, SIZE, SIZE, 1))
    targets = {"noise": targets, "nothing": 0 * targets, "less than nothing": -abs(targets)}[wanted]
    problem = problem_of(device, targets, least=0.01, ridge=ridge)
    start = np.abs(random.normal(size=problem.operator.domain)) + 0.02
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


@pytest.mark.full
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
    with pytest.raises(NonFiniteError, match="y holds NaN"):
        solved(device, raw, pictures)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"every": -1}, "SolveSettings: every is -1"),
        ({"every": 2.5}, "every is 2.5"),
        ({"views": 0}, "views is 0"),
        ({"iterations": 0}, "iterations is 0"),
        ({"ridge": -1e-3}, r"ridge is -0.001"),
        ({"ridge": float("nan")}, "ridge is nan"),
    ],
)
def test_bad_settings_are_refused_by_name(given, words):
    with pytest.raises(InputError, match=words):
        SolveSettings(**given)


def test_splats_that_hide_one_another_are_not_solved_for(device):
    pictures = pictures_of(device, scene(0))
    settings = replace(TrainSettings(steps=5), solve=SolveSettings(2))
    with pytest.raises(InputError, match=r"every is 2"):
        Trainer(pictures, Parameters.of(device, scene(0)), settings)
