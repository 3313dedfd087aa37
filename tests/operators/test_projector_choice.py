"""The choice of a projector: by size and accuracy, never by chance."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Cone, FastProjector, Grid, Parallel, fbp
from rift_cl.errors import InputError
from rift_cl.metrics import psnr
from rift_cl.operators import cheapest_projector
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram

pytestmark = pytest.mark.dealt


def half_turn(views, bins, **settings):
    return Parallel(np.linspace(0, np.pi, views, endpoint=False), bins, **settings)


def large(device):
    """Samples along an edge from which slices go through the spectrum."""
    return 512 if device.traits.is_cpu else 4096


@pytest.mark.parametrize("iterative", [False, True])
def test_large_slices_go_through_the_spectrum_and_small_ones_do_not(device, iterative):
    for n, kind in ((16, PhaseProjector), (64, PhaseProjector), (large(device), FastProjector)):
        grids = Grid((n, n)), Grid((3, n, n))
        for grid in grids:
            A = cheapest_projector(grid, half_turn(n, n), iterative=iterative, device=device)
            assert type(A) is kind
            assert A.grid == grid


def test_few_views_or_few_pixels_are_projected_directly(device):
    for grid, scan in (
        (Grid((600, 600)), half_turn(3, 600)),
        (Grid((20, 20)), half_turn(20, 200)),
        (Grid((8, 8)), half_turn(900, 12, pitch=1e-4)),
    ):
        assert type(cheapest_projector(grid, scan, device=device)) is PhaseProjector


def test_a_smaller_error_is_kept_to(device):
    n = large(device)
    grid, scan = Grid((n, n)), half_turn(n, n)
    chosen = [cheapest_projector(grid, scan, error=e, device=device) for e in (1e-2, None, 1e-5)]
    errors = [A.gridding.error for A in chosen]
    assert errors == sorted(errors, reverse=True)
    assert errors[2] <= 1e-5


def test_whoever_names_a_footprint_gets_it(device):
    A = cheapest_projector(Grid((512, 512)), half_turn(512, 512), footprint="strip", device=device)
    assert type(A) is PhaseProjector
    assert A.footprint == "strip"
    with pytest.raises(InputError, match="one of them"):
        cheapest_projector(Grid((9, 9)), half_turn(9, 9), footprint="strip", error=1e-3)
    with pytest.raises(InputError, match="error is"):
        cheapest_projector(Grid((9, 9)), half_turn(9, 9), error=-1, device=device)


@pytest.mark.parametrize(
    ("views", "bins", "pitch"), [(256, 256, 1.0), (384, 363, 1.0), (384, 726, 0.5)]
)
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_formula_loses_nothing_by_its_error(device, views, bins, pitch, noise):
    grid, scan = Grid((256, 256)), half_turn(views, bins, pitch=pitch)
    truth, y = shepp_logan(grid), shepp_logan_sinogram(grid, scan)
    y = y + noise * y.max() * np.random.default_rng(3).standard_normal(y.shape).astype(np.float32)
    n = large(device)
    error = cheapest_projector(Grid((n, n)), half_turn(n, n), device=device).error
    fast = FastProjector(grid, scan, error, device=device)
    direct = PhaseProjector(grid, scan, device=device)
    assert psnr(fbp(fast, y), truth) > psnr(fbp(direct, y), truth) - 0.05


def test_scans_that_are_not_parallel_have_one_projector():
    cone = Cone([0.0, 1.0], 8, 8, 1.0, 20, 30)
    with pytest.raises(InputError, match="Cone"):
        cheapest_projector(Grid((4, 8, 8)), cone)
