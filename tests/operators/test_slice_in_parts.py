"""A slice that is larger than a device's memory, or its largest array, is taken in parts."""

from __future__ import annotations

import numpy as np
import pytest
from limited_devices import assert_same, limited, normal

import rift_cl as rift
from rift_cl.errors import ResourceLimitError
from rift_cl.operators import ViewFilter, cheapest_projector
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector

# Larger than a run of 64 rows, off the middle, and looked at along both axes.
GRID = rift.Grid((256, 150), 0.7, (3.0, -5.0))
STACK = rift.Grid((2, 256, 150), 0.7, (1.0, 3.0, -5.0))
SCAN = rift.Parallel(np.linspace(0, 3.1, 240) + 0.1, 200, center=90.3)
IMAGE_BYTES = 4 * 256 * 150


def parts(A: rift.Projector) -> tuple[int, int]:
    budget = A.device.budget
    return len(list(A._chunks(budget))), len(list(A._adjoint_chunks(budget)))


def there(A: rift.Projector) -> list[np.ndarray]:
    return [A(normal(*A.domain))]


def back(A: rift.Projector) -> list[np.ndarray]:
    y = normal(*A.range)
    return [A.T(y), rift.fbp(A, y), rift.backproject(A, y)]


@pytest.mark.parametrize(
    ("dtype", "grid"),
    [("float32", GRID), pytest.param("float64", STACK, marks=pytest.mark.full)],
)
def test_views_of_a_projection_and_rows_of_a_backprojection_have_the_same_bits(device, dtype, grid):
    """A memory that holds no slice with all that it needs."""
    whole = rift.Projector(grid, SCAN, device=device, dtype=dtype)
    small = limited(device, np.dtype(dtype).itemsize // 4 * 900_000)
    A = rift.Projector(grid, SCAN, device=small, dtype=dtype)
    assert min(parts(A)) > grid.slices, "slices are cut"
    assert_same(there(A) + back(A), there(whole) + back(whole))


def test_an_image_larger_than_the_largest_array_is_backprojected_in_bands(device):
    scan = rift.Parallel(SCAN.angles[::2], 200)
    small = limited(device, allocation=IMAGE_BYTES - 4)
    A, whole = (rift.Projector(GRID, scan, device=each) for each in (small, device))
    assert_same(back(A), back(whole))


@pytest.mark.full
def test_what_is_cut_both_ways_is_added_up_to_rounding(device):
    """Neither the image nor the sinogram is as small as the largest array."""
    small = limited(device, allocation=120_000)
    A, whole = (rift.Projector(GRID, SCAN, device=each) for each in (small, device))
    assert min(parts(A)) >= 4
    for one, other in zip(there(A) + back(A), there(whole) + back(whole), strict=True):
        assert np.abs(one - other).max() <= 2e-6 * np.abs(other).max()


def test_not_even_a_part_fits(device):
    A = rift.Projector(GRID, SCAN, device=limited(device, 5_000))
    with pytest.raises(ResourceLimitError, match=r"part of a slice \(\d+ rows in 1 views\)"):
        A(normal(*A.domain))


@pytest.mark.parametrize(
    ("bins", "rows"),
    [(40, None), (400, None), pytest.param(400, 2, marks=pytest.mark.full)],
)
def test_views_with_gains_of_their_own_are_filtered_in_runs(device, bins, rows):
    scan = rift.Parallel(np.linspace(0, 3, 160), bins)

    def gains(f):
        return 1 + np.arange(160)[:, None] * f

    for given in (gains, np.arange(160.0)):
        small = limited(device, allocation=4 * bins * (rows or 1) * 80)
        F, whole = (
            ViewFilter(scan, rift.Ramp(), rows=rows, gains=given, device=each)
            for each in (small, device)
        )
        y = normal(*F.domain)
        assert_same([F(y), F.T(y)], [whole(y), whole.T(y)])


@pytest.mark.once
def test_a_slice_too_large_for_the_spectrum_is_left_to_the_projector_that_takes_parts(device):
    grid, scan = rift.Grid((512, 512)), rift.Parallel(np.linspace(0, 3, 512), 512)
    cpu = limited(device, is_cpu=True)
    assert type(cheapest_projector(grid, scan, device=cpu)) is rift.FastProjector
    for small in (limited(cpu, 8 << 20), limited(cpu, allocation=1 << 20)):
        with pytest.warns(UserWarning, match="Projector is used"):
            A = cheapest_projector(grid, scan, device=small)
        assert type(A) is PhaseProjector


@pytest.mark.once
def test_a_slice_too_large_for_the_fourier_projector_is_refused_with_what_takes_it(device):
    scan, words = (
        rift.Parallel(np.linspace(0, 3, 40), 64),
        "FastProjector cannot .*rift.Projector can",
    )
    for small in (limited(device, 150_000), limited(device, allocation=30_000)):
        A = rift.FastProjector(rift.Grid((64, 64)), scan, device=small)
        for apply in (A, A.T):
            with pytest.raises(ResourceLimitError, match=words):
                apply(normal(*apply.domain))
