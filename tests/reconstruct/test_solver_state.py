"""What a solver keeps is its own: data, states, spacing and memory."""

from __future__ import annotations

import numpy as np
import pytest
from solver_cases import GRID, METHODS, SCAN, problem

from rift_cl import Device, Parallel, Projector
from rift_cl.errors import CheckpointError, InputError, ResourceLimitError
from rift_cl.reconstruct import Cgls, Fista, tv

pytestmark = pytest.mark.once

every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


@every_method
def test_data_on_the_device_may_change_behind_a_run(device, method):
    A, _, _, y = problem(device)
    given = device.array(y)
    one, other = method(A, given), method(A, y)
    list(one.run(2))
    given.fill(0)
    list(one.run(4))
    list(other.run(4))
    assert np.array_equal(device.get(one.image), device.get(other.image))


@every_method
def test_a_state_of_other_angles_or_other_data_is_refused(device, method):
    A, _, _, y = problem(device)
    solver = method(A, y)
    list(solver.run(3))
    turned = Projector(GRID, Parallel(SCAN.angles**1.2, SCAN.bins, SCAN.pitch), device=device)
    for stranger in (method(turned, y), method(A, 2 * y)):
        with pytest.raises(CheckpointError, match="another A or another y"):
            stranger.restore(solver.state())
        assert next(iter(stranger.run(1))).done == 1


@every_method
def test_numbers_that_no_run_has_are_refused(device, method):
    A, _, _, y = problem(device)
    solver = method(A, y)
    list(solver.run(2))
    with pytest.raises(CheckpointError, match="-5 for step"):
        solver.restore({**solver.state(), "step": np.asarray(-5)})


def test_fista_wants_a_norm_and_a_denoising_step(device):
    A, _, _, y = problem(device)
    solver = Fista(A, y, 0.1)
    with pytest.raises(CheckpointError, match="for largest"):
        solver.restore({**solver.state(), "largest": np.asarray(0.0)})
    with pytest.raises(InputError, match="inner is 0"):
        Fista(A, y, 0.1, inner=0)


def test_a_multiple_of_a_projector_has_its_spacing(device):
    A, _, _, y = problem(device)
    assert (1 * A).grid == A.grid
    np.testing.assert_allclose(tv(1 * A, y, 0.5, 20), tv(A, y, 0.5, 20), atol=1e-5)


def test_a_ramp_is_found_for_a_multiple_too(device):
    A, _, _, y = problem(device)
    twice = Cgls(2 * A, 2 * y, precondition="ramp")
    once = Cgls(A, y, precondition="ramp")
    for solver in (twice, once):
        list(solver.run(2))
    np.testing.assert_allclose(device.get(twice.image), device.get(once.image), atol=1e-4)


@every_method
def test_a_budget_that_a_run_exceeds_is_told_before(device, method, monkeypatch):
    A, _, _, y = problem(device)
    monkeypatch.setattr(Device, "budget", A.scratch + 4 * y.nbytes)
    with pytest.raises(ResourceLimitError, match="one solver needs"):
        method(A, device.array(y))


def test_a_run_that_nothing_changes_reports_nothing(device):
    A, _, _, y = problem(device)
    assert list(Cgls(A, 0 * y).run(5)) == []
