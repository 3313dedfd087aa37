"""Splats as voxels: the laws that their sums obey, and the twin that they are equal to.

Mass, blur and projection are known in closed form. The twin shares no step with the kernels: it
factors covariances from below and not from above, and transforms modes as tensors.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from voxel_scenes import assert_like_twin, drawn, expected, random_splats

import rift_cl as rift
from rift_cl.basis.indices import graded
from rift_cl.reference.voxels import edge, graded_tensors
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.splat.orders import count_of
from rift_cl.train.xray.voxels import Footprints

pytestmark = pytest.mark.dealt

ORDERS = (0, 1, 2, 4, 8)
# Neither symmetric nor even, and no whole number of bricks.
GRID = rift.Grid((13, 19, 37), (0.11, 0.09, 0.05), (0.2, -0.1, 0.3))
UNEVEN = (0.004, 0.0, 0.011)


def test_the_twins_dilation_is_a_mean_over_shifted_splats():
    """Blurring is averaging over shifts; Gauss's quadrature over them is exact enough."""
    values = random_splats(2, order=4, scales=(0.3, 0.5))
    grid, blur = rift.Grid((3, 4, 5), 0.3), np.array([0.004, 0.01, 0.007])
    nodes, weights = np.polynomial.hermite_e.hermegauss(6)
    total = np.zeros(grid.shape)
    for place in product(range(len(nodes)), repeat=3):
        shifted = {**values, "means": values["means"] + np.sqrt(blur) * nodes[list(place)]}
        share = np.prod(weights[list(place)] / weights.sum())
        total += share * expected(shifted, grid, reach=np.inf)
    found = expected(values, grid, blur, reach=np.inf)
    assert np.abs(found - total).max() < 1e-6 * np.abs(found).max()


def test_the_twins_modes_stand_in_graded_order():
    for number, orders in enumerate(graded(4, 3)[1:]):
        *_, tensor = graded_tensors(np.eye(count_of(4) - 1)[number, : number + 1])
        ((*place,), *others) = np.argwhere(tensor)
        assert not others
        assert np.bincount(place, minlength=3).tolist() == orders.tolist()


@pytest.mark.parametrize("dilation", [0.0, UNEVEN])
@pytest.mark.parametrize("order", ORDERS)
def test_the_kernels_equal_the_twin(device, order, dilation):
    assert_like_twin(device, random_splats(15, order=order), GRID, dilation)


@pytest.mark.parametrize("order", [0, 2])
def test_needles_sheets_huge_and_tiny_splats_equal_the_twin(device, order):
    values = random_splats(8, order=order, spread=0.3)
    values["scales"][:5] = [
        (1, 0.01, 0.01),
        (1, 1, 0.01),
        (3e3, 2e3, 4e3),
        (1e-4, 1e-4, 1e-4),
        (2e-2, 3.0, 1e-3),
    ]
    values["means"][2] = (900, -1200, 800)
    # A blur of about a voxel: without it the grid steps over sheets, and so would the comparison.
    assert_like_twin(device, values, GRID, (0.003, 0.008, 0.012), share=2e-5)


def test_places_far_from_the_origin_lose_nothing(device):
    """Only the float32 of the means themselves may be felt, and the twin has that as well."""
    values = random_splats(10, scales=(0.5, 3))
    values["means"] = (values["means"] * 5 + (4000, -3000, 1000)).astype(np.float32)
    assert_like_twin(device, values, rift.Grid((9, 9, 20), 1.0, (1000, -3000, 4000)))


def test_order_zero_equals_the_footprints_of_the_trainer(device):
    """Inside 3.5 standard deviations, where both have a splat; outside, less than 3e-3 each."""
    values = random_splats(1, spread=0.1, scales=(0.1, 0.25))
    grid = rift.Grid((25, 30, 35), 0.05)
    exact = {name: array.astype(float) for name, array in values.items()}
    footprints = Footprints(grid, *(exact[n] for n in ("means", "quats", "scales")), dilation=0.002)
    sums, found = footprints.sums(exact["opacities"]), drawn(device, values, grid, 0.002)
    inside = expected(values, grid, 0.002, reach=3.499) != 0
    peak = np.abs(sums).max()
    assert 200 < inside.sum() < 0.9 * inside.size
    assert np.abs(found - sums)[inside].max() <= 1e-5 * peak
    assert np.abs(found - sums).max() <= 3e-3 * peak


@pytest.mark.parametrize("dilation", [0.0, (0.01, 0.02, 0.005)])
@pytest.mark.parametrize("order", [0, 1, 2, 4])
def test_mass_is_that_of_the_gaussians_whatever_the_modes_and_the_dilation(device, order, dilation):
    """A mode is a derivative: its integral is zero; beyond the edge lies 1.1e-3 of a Gaussian."""
    values = random_splats(6, order=order, spread=0.2, scales=(0.12, 0.18))
    grid = rift.Grid((42, 42, 42), 0.07)
    mass = (2 * np.pi) ** 1.5 * values["opacities"] * values["scales"].astype(float).prod(axis=1)
    found = drawn(device, values, grid, dilation).sum(dtype=float) * 0.07**3
    assert abs(found - mass.sum()) <= 3e-3 * np.abs(mass).sum()


@pytest.mark.parametrize("order", [0, 1, 3])
def test_line_sums_are_what_the_rasterizer_draws(device, order):
    """Slices blurred across x and y as the rasterizer does, and along its rays by nothing."""
    spacing, eps2d = 0.05, 0.3
    values = random_splats(6, order=order, spread=0.3, scales=(0.08, 0.16))
    # The rasterizer leaves out what has less than no density at its mean.
    values["opacities"] = np.abs(values["opacities"]) + np.float32(0.1)
    grid = rift.Grid((64, 50, 56), spacing, (0, 0.07, -0.04))
    view, middle = np.eye(4), np.array(grid.center)
    view[2, 3] = 10
    cx, cy = 28 - middle[2] / spacing, 25 - middle[1] / spacing
    inner = [[1 / spacing, 0, cx], [0, 1 / spacing, cy], [0, 0, 1]]
    camera = rift.Camera((50, 56), inner, view, "ortho")
    renderer = Renderer(SplatSettings(mode="xray", eps2d=eps2d), device=device)
    splats = Splats.upload(device, **values, colors=np.ones((6, 1)))
    image = device.get(renderer.forward(splats, camera).image)[..., 0]
    blur = eps2d * spacing**2
    sums = drawn(device, values, grid, (blur, blur, 0)).sum(axis=0, dtype=float) * spacing
    assert np.abs(sums - image).max() <= 1e-3 * np.abs(image).max()


def test_the_edge_is_where_modes_fall_below_a_gaussians_at_four():
    assert edge(0) == pytest.approx(4)
    places = np.linspace(0, 12, 4001)
    for order in range(9):
        mode = np.polynomial.hermite_e.hermeval(places, [0] * order + [1])
        mode *= np.exp(-(places**2) / 2) / np.sqrt(float(np.prod(np.arange(1.0, order + 1))))
        assert np.abs(mode)[places > edge(order)].max() <= np.exp(-8) * (1 + 1e-9)
        assert np.abs(mode)[places > edge(order) - 0.02].max() > np.exp(-8)
