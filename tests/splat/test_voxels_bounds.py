"""Voxels of splats: bits, memory, the smallest and oddest cases, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from voxel_scenes import assert_like_twin, drawn, expected, random_splats

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ResourceLimitError, ShapeError
from rift_cl.reference.splat_projection import covariances
from rift_cl.splat import Splats
from rift_cl.splat.voxels import voxelise

pytestmark = pytest.mark.dealt

GRID = rift.Grid((21, 40, 50), 0.06, (0.1, 0, 0))


def test_the_same_call_gives_the_same_bits(device):
    values = random_splats(200, order=2, scales=(0.03, 0.15))
    runs = [drawn(device, values, GRID, 0.002) for _ in range(3)]
    assert runs[0].any() and all(np.array_equal(runs[0], run) for run in runs)


@pytest.mark.full
def test_a_small_budget_gives_the_same_bits_in_more_bands(device, monkeypatch):
    values, bands = random_splats(600, order=1, scales=(0.03, 0.12)), []
    whole = drawn(device, values, GRID)
    need = 4 * (GRID.shape[0] * GRID.shape[1] * GRID.shape[2] + 600 * (14 + 16 + 9))
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=need + 55_000)
    launch = small.launch

    def counted(kernel, work, /, **given):
        bands.append(kernel)
        launch(kernel, work, **given)

    monkeypatch.setattr(small, "launch", counted)
    assert np.array_equal(drawn(small, values, GRID), whole)
    # Three layers of bricks in all; the fullest is cut.
    assert bands.count("hermite_voxelise") > 3


def test_what_fits_no_budget_is_told(device):
    splats = random_splats(600)
    for memory, match in ((150_000, "volume of"), (280_000, "one row of tiles")):
        small = rift.Device(device._handle, device.selector, traits=device.traits, memory=memory)
        with pytest.raises(ResourceLimitError, match=match):
            drawn(small, splats, GRID)


@pytest.mark.parametrize("shape", [(1, 30, 40), (30, 1, 40), (30, 40, 1), (1, 1, 1)])
def test_grids_of_one_sample_along_an_axis(device, shape):
    assert_like_twin(device, random_splats(9, order=2, spread=0.3), rift.Grid(shape, 0.05), 0.001)


def test_parts_of_a_grid_are_parts_of_the_whole(device):
    values = random_splats(20, order=1)
    whole, part = drawn(device, values, GRID), rift.Grid((5, 40, 50), 0.06, (0.1 - 0.06 * 4, 0, 0))
    assert np.abs(drawn(device, values, part) - whole[4:9]).max() <= 1e-5 * np.abs(whole).max()


def test_no_splats_and_splats_outside_leave_nothing(device):
    nothing, outside = random_splats(0, order=1), random_splats(5)
    outside["means"] += np.float32(50)
    assert not drawn(device, nothing, GRID).any()
    assert not drawn(device, outside, GRID).any()


def test_splats_that_are_none_are_left_out(device):
    values = random_splats(12, order=2)
    good = slice(8, None)
    values["means"][0, 1] = np.nan
    values["means"][1, 0] = np.inf
    values["quats"][2] = 0
    values["scales"][3, 2] = 0
    values["scales"][4, 0] = np.inf
    values["opacities"][5] = np.nan
    values["shape_modes"][6, 3] = np.inf
    values["scales"][7] = -1
    kept = {name: array[good] for name, array in values.items()}
    assert np.array_equal(drawn(device, values, GRID, 0.001), drawn(device, kept, GRID, 0.001))


def test_extreme_numbers_leave_finite_voxels(device):
    values = random_splats(6)
    values["scales"][:5] = [(1e-30,) * 3, (1e30,) * 3, (1e-18, 1, 1e18), (3e38,) * 3, (1e-38,) * 3]
    values["means"][5] = 3e38
    for dilation in (0.0, 1e-30, 1e30):
        assert np.isfinite(drawn(device, values, GRID, dilation)).all()


def test_covariances_draw_what_quaternions_and_scales_do(device):
    values = random_splats(10)
    exact = {name: array.astype(float) for name, array in values.items()}
    whole = expected(values, GRID, 0.002)
    given = {"covars": covariances(exact["quats"], exact["scales"])}
    splats = Splats.upload(device, means=values["means"], opacities=values["opacities"], **given)
    found = device.get(voxelise(device, splats, GRID, dilation=0.002))
    assert np.median(np.abs(found - whole)) < 1e-6 * np.abs(whole).max()
    assert np.abs(found - whole).max() < 1e-3 * np.abs(whole).max()


@pytest.mark.parametrize(
    "dilation", [-1, (1, 2), (0, 0, -1e-9), np.nan, np.inf, "wide", None, 1e38]
)
def test_dilations_that_are_none_are_refused(device, dilation):
    with pytest.raises(InputError, match=r"voxelise: dilation"):
        drawn(device, random_splats(3), GRID, dilation)


def test_what_is_no_volume_and_no_splats_is_refused(device):
    splats = Splats.upload(device, **random_splats(3))
    for grid in (rift.Grid((4, 5)), (4, 5, 6), None):
        with pytest.raises(ShapeError, match=r"voxelise: grid"):
            voxelise(device, splats, grid)
    with pytest.raises(InputError, match="16777216 samples"):
        voxelise(device, splats, rift.Grid((1, 1, (1 << 24) + 1)))
    with pytest.raises(DTypeError, match="on the host"):
        voxelise(device, Splats(**random_splats(3)), GRID)
    with pytest.raises(InputError, match="no order"):
        Splats.upload(device, **random_splats(3), shape_modes=np.zeros((3, 5)))
