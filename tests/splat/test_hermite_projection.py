"""Modes on the screen: against their twin, against a bound's definition, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from hermite_projection_scenes import MODALS, Modal, in_double, modal_splats, twin_of
from projection_scenes import arrays_of

from rift_cl.reference.hermite_projection import reach, squares_of_order
from rift_cl.splat.projection import project
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt


def projected_on(device, values, modal):
    """What projection gives, and the table of modes, on the host."""
    splats, given = Splats.upload(device, **values), (modal.camera, modal.settings)
    projected = project(device, splats, *given)
    found = {name: device.get(array) for name, array in arrays_of(projected).items()}
    return found | {"table": device.get(projected.modes.table)}


@pytest.mark.parametrize("name", MODALS)
def test_modes_on_the_screen_are_the_twins(device, name):
    modal = MODALS[name]
    values = modal_splats(modal, 200)
    found = projected_on(device, values, modal)
    seen, modes = twin_of(values, modal)
    drawn = found["culled"] == 0
    assert drawn.sum() > 120
    table, right = found["table"][drawn].astype(float), modes.table[drawn]
    whitening = np.abs(table - right)[:, :3].max(1) / np.abs(right[:, :3]).max(1)
    assert whitening.max() < 1e-5
    if right.shape[1] > 3:
        size = np.linalg.norm(right[:, 3:], axis=1)
        assert (np.linalg.norm((table - right)[:, 3:], axis=1) / size).max() < 1e-5
    assert not found["table"][~drawn].any()
    # The rest of the projection is what it is without modes.
    np.testing.assert_allclose(found["screen"][drawn, :2], seen.means[drawn], rtol=0, atol=2e-3)
    np.testing.assert_allclose(found["screen"][drawn, 5], seen.weights[drawn], rtol=1e-5)


def extents_in_deviations(found, seen):
    """Extents as multiples of the standard deviations on the screen."""
    return found["screen"][:, 6] / np.sqrt(seen.covars[:, 0, 0])


@pytest.mark.parametrize("strength", [0.05, 0.4, 3.0])
@pytest.mark.parametrize(
    "shape, activation", [(1, "clamp"), (4, "exp"), (8, "clamp"), (2, "square")]
)
def test_extents_are_those_of_the_bound(device, shape, activation, strength):
    modal = Modal(shape, settings=SplatSettings(activation=activation))
    values = modal_splats(modal, 200, strength=strength)
    values["opacities"] = np.float32(np.geomspace(1e-4, 5, 200))
    found, (seen, _) = projected_on(device, values, modal), twin_of(values, modal)
    modes = in_double(values)["shape_modes"]
    wanted = reach(seen.weights, modes, squared=activation == "square")
    drawn, mine = found["culled"] == 0, extents_in_deviations(found, seen)
    assert drawn.sum() > 80
    assert (mine[drawn] >= wanted[drawn] - 2e-3).all(), "no bound"
    assert (mine[drawn] <= 6.001).all()
    # A few steps come close to where the bound ends; those that hardly reach it stop earlier.
    seen_at_all = drawn & (wanted > 0)
    assert np.median(mine[seen_at_all] / wanted[seen_at_all]) < 1.04
    assert (drawn & (wanted == 0)).sum() < 20
    assert not wanted[found["culled"] == 3].any(), "left out although it could be seen"


@pytest.mark.full
def test_extents_of_other_activations_without_modes_are_exact(device):
    modal = MODALS["no modes, exp"]
    values = modal_splats(modal, 200)
    values["opacities"] = np.float32(np.geomspace(1e-3, 20, 200))
    found, (seen, _) = projected_on(device, values, modal), twin_of(values, modal)
    drawn = found["culled"] == 0
    right = np.minimum(np.sqrt(2 * np.log(255 * seen.weights[drawn])), 6)
    np.testing.assert_allclose(extents_in_deviations(found, seen)[drawn], right, rtol=1e-3)
    assert (found["culled"][seen.weights < 1 / 255.1] > 0).all()


@pytest.mark.full
@pytest.mark.parametrize("shape, color, radius", [(1, 0, 4.353), (0, 2, 4.619), (8, 1, 5.491)])
def test_line_integrals_reach_as_far_as_their_order_says(device, shape, color, radius):
    modal = Modal(shape, color, settings=SplatSettings(mode="xray"))
    values = modal_splats(modal, 50)
    found, (seen, _) = projected_on(device, values, modal), twin_of(values, modal)
    drawn = found["culled"] == 0
    np.testing.assert_allclose(extents_in_deviations(found, seen)[drawn], radius, rtol=1e-4)


@pytest.mark.parametrize("order", range(1, 9))
def test_what_the_bound_is_made_of_is_the_same_in_every_direction(order):
    """And no less far out than nearer: splat_project counts on it from 1.64 on."""
    radii = np.linspace(0, 8, 4001)
    squares = squares_of_order(order, radii)
    highest = np.maximum.accumulate(squares)
    far = radii >= 1.64
    np.testing.assert_allclose(squares[far], highest[far], rtol=1e-12)
    turn, he = 0.7, np.polynomial.hermite_e.HermiteE.basis
    norms = np.sqrt([float(np.prod(range(1, n + 1))) for n in range(order + 1)])
    along, across = radii * np.cos(turn), radii * np.sin(turn)
    turned = sum(
        (he(order - j)(along) / norms[order - j] * he(j)(across) / norms[j]) ** 2
        for j in range(order + 1)
    )
    np.testing.assert_allclose(turned, squares, rtol=1e-9)


@pytest.mark.full
def test_no_order_is_amplified(device):
    """A A^T <= I: on the screen an order is never longer than it was in space."""
    modal = MODALS["orders 3 and 4, fisheye"]
    values = modal_splats(modal, 200)
    found = projected_on(device, values, modal)
    drawn = found["culled"] == 0
    in_space, on_screen = values["shape_modes"][drawn], found["table"][drawn, 3:12]
    for before, after in (((0, 3), (0, 2)), ((3, 9), (2, 5)), ((9, 19), (5, 9))):
        long = np.linalg.norm(in_space[:, slice(*before)], axis=1)
        assert (np.linalg.norm(on_screen[:, slice(*after)], axis=1) <= long * (1 + 1e-5)).all()


@pytest.mark.full
def test_needles_keep_their_digits(device):
    """The second row of A is a difference of nearly equal numbers, if it is written so."""
    modal = Modal(2, settings=SplatSettings(eps2d=0.01))
    values = modal_splats(modal, 200, wide=0.5)
    values["scales"] = np.tile(np.float32([1.0, 1e-3, 1e-3]), (200, 1))
    found, (_, modes) = projected_on(device, values, modal), twin_of(values, modal)
    drawn = found["culled"] == 0
    assert drawn.sum() > 150
    away = np.abs(found["table"] - modes.table)[drawn, 3:].max(1)
    assert np.median(away) < 5e-6
    assert away.max() < 5e-4


def test_two_runs_give_the_same_bits(device):
    modal = MODALS["orders 2 and 1, ortho"]
    values = modal_splats(modal)
    first, second = (projected_on(device, values, modal) for _ in range(2))
    for name, array in first.items():
        assert array.tobytes() == second[name].tobytes(), name
