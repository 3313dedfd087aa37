"""SIRT on the projector by the Fourier slice theorem, whose sums ring about zero beside edges."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import FastProjector, Grid, Parallel, Projector
from rift_cl.cl.array_home import ArrayHome
from rift_cl.metrics import psnr
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram
from rift_cl.reconstruct.solvers.simultaneous_iteration import inverse_sums

pytestmark = pytest.mark.once

HALF = np.linspace(0, np.pi, 100, endpoint=False)
SCENES = {
    "detector wider than the image": (Grid((64, 64)), Parallel(HALF, bins=91)),
    "as wide": (Grid((96, 96)), Parallel(HALF, bins=96)),
    "narrower": (Grid((64, 64)), Parallel(HALF, bins=40)),
    "fine bins": (Grid((48, 48)), Parallel(HALF, bins=140, pitch=0.5)),
    "wide bins": (Grid((64, 64)), Parallel(HALF, bins=46, pitch=2.0)),
    "off-centre axis": (Grid((96, 96)), Parallel(HALF, bins=151, center=60.4)),
    "uneven pixels": (Grid((40, 80), spacing=(2.0, 1.0)), Parallel(HALF, bins=117)),
    "limited angle": (Grid((64, 64)), Parallel(HALF[:33], bins=91)),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("nonnegative", [False, True])
def test_it_is_as_good_as_on_the_direct_projector(device, name, nonnegative):
    grid, scan = SCENES[name]
    sinogram, truth = shepp_logan_sinogram(grid, scan), shepp_logan(grid)
    direct, fast = (
        psnr(
            rift.sirt(kind(grid, scan, device=device), sinogram, 60, nonnegative=nonnegative), truth
        )
        for kind in (Projector, FastProjector)
    )
    assert fast > direct - 0.1


@pytest.mark.full
def test_steps_never_grow_the_residual(device):
    """Weights that ringing has made large would: 200 steps at nearly the greatest relaxation."""
    grid, scan = SCENES["detector wider than the image"]
    A = FastProjector(grid, scan, device=device)
    y = shepp_logan_sinogram(grid, scan)
    y += np.random.default_rng(1).standard_normal(y.shape).astype(np.float32)
    curve = [
        np.linalg.norm(A(rift.sirt(A, y, steps, relaxation=1.9)) - y) for steps in (1, 5, 25, 200)
    ]
    assert curve == sorted(curve, reverse=True)


def test_no_ray_gets_more_weight_than_ringing_allows(device):
    grid, scan = SCENES["detector wider than the image"]
    A = FastProjector(grid, scan, device=device)
    sums = A(np.ones(A.domain))
    assert sums.min() < -1e-3 * sums.max()
    weights = device.get(inverse_sums(A, ArrayHome(device, A.dtype)))
    assert weights.max() <= 1.0001 / -sums.min()
    assert (weights >= 0).all()
