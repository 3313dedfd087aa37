"""The weight of the total variation that follows the noise of the data."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import NonFiniteError
from rift_cl.metrics import psnr
from rift_cl.reconstruct import MeasuredRays, tv, variation_weight
from rift_cl.reconstruct.solvers.variation_weight import noise_of_rays

VIEWS, BINS, SIZE = 60, 56, 48


def measured(device, noise, *, pitch=1.0, order=None, seed=0):
    """A projector, the head's line integrals with noise, and the head."""
    angles = np.arange(VIEWS) * np.pi / VIEWS
    grid = rift.Grid((SIZE, SIZE), spacing=pitch)
    scan = rift.Parallel(angles, BINS, pitch=pitch)
    exact = rift.phantom.shepp_logan_sinogram(grid, scan)
    random = np.random.default_rng(seed)
    y = (exact + noise * exact.max() * random.normal(size=exact.shape)).astype(np.float32)
    if order is not None:
        y, scan = y[order], rift.Parallel(angles[order], BINS, pitch=pitch)
    return rift.Projector(grid, scan, device=device), y, rift.phantom.shepp_logan(grid)


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_noise_is_found_within_a_fifth(device, share):
    _, y, _ = measured(device, share)
    found = noise_of_rays(y, np.ones_like(y))
    assert found == pytest.approx(share * measured(device, 0)[1].max(), rel=0.2)


def test_the_weight_has_the_unit_of_the_variation(device):
    """In other units of length and of attenuation it stands for the same image."""
    A, y, _ = measured(device, 0.05)
    finer, _, _ = measured(device, 0, pitch=0.01)
    # Data in float32 are rounded anew, which moves the median by some 1e-6 of it.
    weight = variation_weight(A, y)
    assert variation_weight(finer, 0.01 * y) == pytest.approx(0.01 * weight, rel=1e-5)
    assert variation_weight(A, 7 * y) == pytest.approx(7 * weight, rel=1e-5)


def test_of_volumes_the_unit_of_length_does_not_count(device):
    rays = np.random.default_rng(0).random((12, 8, 10)).astype(np.float32)
    found = []
    for unit in (1.0, 0.01):
        lengths = {"pitch": unit, "source_to_axis": 40 * unit, "source_to_detector": 60 * unit}
        cone = rift.Cone(np.arange(12) * np.pi / 6, 8, 10, **lengths)
        A = rift.Projector(rift.Grid((8, 8, 8), spacing=unit), cone, device=device)
        found.append(variation_weight(A, unit * rays))
    assert found[0] == pytest.approx(found[1], rel=1e-5)


def test_neither_order_nor_rays_that_were_not_measured_count(device):
    A, y, _ = measured(device, 0.05)
    order = np.random.default_rng(1).permutation(VIEWS)
    shuffled, moved, _ = measured(device, 0.05, order=order)
    assert variation_weight(shuffled, moved) == pytest.approx(variation_weight(A, y))
    turns = 2 * np.pi * np.r_[0, np.random.default_rng(2).integers(0, 4, VIEWS - 1)]
    turned = rift.Parallel(A.scan.angles + turns, BINS)
    many = rift.Projector(A.grid, turned, device=device)
    assert variation_weight(many, y) == pytest.approx(variation_weight(A, y))
    seen = np.ones(y.shape, bool)
    seen[:, :8] = False
    known, lost = np.where(seen, y, 0), np.where(seen, y, np.nan)
    weight = variation_weight(A, known, weights=seen)
    assert variation_weight(A, lost, weights=seen) == weight
    assert variation_weight(MeasuredRays(A, seen), lost) == weight


def test_the_scale_of_weights_does_not_matter_to_it(device):
    """As it does not to the solver; nothing wants none."""
    A, y, _ = measured(device, 0.05)
    weights = np.random.default_rng(5).uniform(0.5, 1.5, y.shape)
    weights[:, :4] = 0
    alike = [variation_weight(A, y, weights=scale * weights) for scale in (1, 4, 2e3, 1e-3)]
    assert alike == pytest.approx([alike[0]] * 4)
    four = variation_weight(A, y, weights=np.full(y.shape, 4.0))
    assert four == pytest.approx(variation_weight(A, y))
    assert variation_weight(A, 0 * y) == 0
    assert variation_weight(A, device.array(y)) == variation_weight(A, y)


@pytest.mark.parametrize(
    ("noise", "steps"), [(0.1, 60), pytest.param(0.03, 300, marks=pytest.mark.full)]
)
def test_it_does_better_than_an_eighth_and_eight_times_as_much(device, noise, steps):
    A, y, truth = measured(device, noise)
    weight = variation_weight(A, y)
    scores = [
        psnr(tv(A, y, factor * weight, steps, nonnegative=True), truth, peak=1.0)
        for factor in (1 / 8, 1, 8)
    ]
    assert scores[1] == max(scores)


def test_data_that_are_no_numbers_are_named_where_they_count(device):
    A, y, _ = measured(device, 0.02)
    y[3, 5] = np.nan
    with pytest.raises(NonFiniteError, match=r"y holds NaN.*\(3, 5\)"):
        variation_weight(A, y)
    counted = np.isfinite(y).astype(float)
    assert variation_weight(A, y, weights=counted) > 0
