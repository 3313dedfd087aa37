"""A region of a slice is that part of the whole one, as far as the method goes.

Phase tables and grids of the Fourier plane begin where the region does, so that it is not the same
to the bit: what differs is a small share of the slice's noise, and no quality.
"""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.metrics import psnr

SIZE, BINS, CENTER = 160, 190, 97.3
GRID = rift.Grid((SIZE, SIZE))
ANGLES = np.arange(250) * np.pi / 250


@pytest.mark.parametrize("part", [(60, 130, 20, 95), (0, 160, 70, 71), (120, 160, 120, 160)])
@pytest.mark.parametrize(
    ("projector", "share"),
    [(rift.Projector, 0.04), (lambda *a: rift.FastProjector(*a, 1e-3), 0.06)],
    ids=["phase tables", "slice theorem"],
)
def test_a_region_is_the_slice_s_part(projector, share, part) -> None:
    scan = rift.Parallel(ANGLES, BINS, center=CENTER)
    sinogram = rift.phantom.shepp_logan_sinogram(GRID, scan)
    noise = np.random.default_rng(0).normal(0, 0.01 * sinogram.max(), sinogram.shape)
    noisy = (sinogram + noise).astype(np.float32)
    left, right, top, bottom = part
    center = ((top + bottom - SIZE) / 2, (left + right - SIZE) / 2)
    region = rift.Grid((bottom - top, right - left), 1.0, center)
    whole = rift.fbp(projector(GRID, scan), noisy)[top:bottom, left:right]
    alone = rift.fbp(projector(region, scan), noisy)
    truth = rift.phantom.shepp_logan(GRID)[top:bottom, left:right]
    error = np.sqrt(np.mean((whole - truth) ** 2))
    assert np.sqrt(np.mean((alone - whole) ** 2)) < share * error
    assert psnr(alone, truth) == pytest.approx(psnr(whole, truth), abs=0.1)
