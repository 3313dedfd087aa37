"""Solvers of volumes that do not fit the device's memory: the same steps, in parts."""

from __future__ import annotations

import numpy as np
import pytest
from limited_devices import limited, normal

from rift_cl import Cone, Grid, Projector, cgls, sirt, tv
from rift_cl.errors import ResourceLimitError
from rift_cl.geometry.leaning import leaning
from rift_cl.reconstruct import Cgls, Fista, Pdhg, Sirt
from rift_cl.reconstruct.solvers.few_levels import FewLevels

pytestmark = pytest.mark.dealt

GRID = Grid((192, 16, 15), (0.5, 2, 2))
CONE = Cone([0.2, 2.0], 30, 10, 5.2, 100, 150)
# Bytes of a quarter of the volume.
SMALL = int(np.prod(GRID.shape))
LEANING = leaning(CONE, 0.03)
WEIGHTS = 0.5 + np.random.default_rng(3).random((2, 30, 10))
METHODS = {
    "cgls": lambda A, y: cgls(A, y, 2),
    "tv": lambda A, y: tv(A, y, 0.02, 3, nonnegative=True),
    "ordered subsets": lambda A, y: sirt(A, y, 2, subsets=2, nonnegative=True),
    "ramp": lambda A, y: sirt(A, y, 2, precondition="ramp", noise=1e-3),
    "sirt": lambda A, y: sirt(A, y, 3),
    "fista": lambda A, y: tv(A, y, 0.02, 3, method="fista"),
    "weighted cgls": lambda A, y: cgls(A, y, 2, weights=WEIGHTS, start=0.1 * np.ones(A.domain)),
    "weighted sirt": lambda A, y: sirt(A, y, 2, weights=WEIGHTS),
    "weighted subsets": lambda A, y: sirt(A, y, 2, weights=WEIGHTS, subsets=2),
}


def full(names, *but):
    return [n if n in but else pytest.param(n, marks=pytest.mark.full) for n in names]


def close(found, wanted):
    return np.abs(found - wanted).max() <= 1e-4 * np.abs(wanted).max()


@pytest.fixture(scope="module")
def problem(device):
    A = Projector(GRID, CONE, device=device)
    box = np.zeros(GRID.shape, np.float32)
    box[30:150, 4:11, 3:10] = 1 + 0.1 * normal(120, 7, 7)
    return A, A(box)


@pytest.mark.full
@pytest.mark.parametrize("method", full(METHODS, "cgls"))
def test_a_volume_four_times_the_memory_is_solved_for(device, problem, method):
    whole, y = problem
    A = Projector(GRID, CONE, device=limited(device, SMALL))
    found = METHODS[method](A, y)
    assert isinstance(found, np.ndarray)
    assert close(found, METHODS[method](whole, y))


@pytest.mark.full
def test_vectors_are_solved_for_in_parts(device, problem):
    y = problem[1]
    whole, A = (Projector(GRID, LEANING, device=d) for d in (device, limited(device, 2 * SMALL)))
    assert close(cgls(A, y, 2), cgls(whole, y, 2))


@pytest.mark.full
@pytest.mark.parametrize("method", full(METHODS, "tv", "weighted subsets"))
def test_where_no_sum_is_cut_parts_have_the_same_bits(device, problem, method):
    """A volume and its projections fit, the arrays of a method do not."""
    whole, y = problem
    need, _ = whole._need(GRID.shape[0], CONE.views, sparing=True)
    A = Projector(GRID, CONE, device=limited(device, need))
    assert METHODS[method](A, y).tobytes() == METHODS[method](whole, y).tobytes()


@pytest.mark.full
@pytest.mark.parametrize(
    "make",
    [
        Cgls,
        Sirt,
        lambda A, y: Fista(A, y, 0.02),
        lambda A, y: Pdhg(A, y, 0.02),
        lambda A, y: FewLevels(A, y, 0.02),
    ],
)
def test_a_run_in_parts_goes_on_from_its_state(device, problem, make):
    y = problem[1]
    A = Projector(GRID, CONE, device=limited(device, 2 * SMALL))
    straight, broken, resumed = (make(A, y) for _ in range(3))
    list(straight.run(2))
    list(broken.run(1))
    resumed.restore(broken.state())
    list(broken.run(2))
    list(resumed.run(2))
    assert not straight.data.home.on_device
    assert np.array_equal(resumed.image, straight.image)
    assert np.array_equal(broken.image, straight.image)


def test_data_on_the_device_stay_there_or_are_refused(device, problem):
    y = problem[1]
    small = limited(device, SMALL)
    A = Projector(GRID, CONE, device=small)
    with pytest.raises(ResourceLimitError, match="give y on the host"):
        cgls(A, small.array(y), 1)


def test_a_disk_without_room_is_told_before_any_work(device, problem, monkeypatch):
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr("shutil.disk_usage", lambda folder: usage)
    monkeypatch.setattr("rift_cl.cl.array_home.host_budget", lambda: 0)
    A = Projector(GRID, CONE, device=limited(device, SMALL))
    with pytest.raises(ResourceLimitError, match="TMPDIR"):
        cgls(A, problem[1], 1)
