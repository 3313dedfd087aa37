"""Factors of rays are those of their NumPy twin, and laying rays back is the transpose."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.reconstruct.direct.ray_factors import RayFactors
from rift_cl.reference import weigh_rays

SHAPE, WIDE = (3, 5, 37), 53


@pytest.mark.parametrize("before", [0, 11, 16])
@pytest.mark.parametrize(("rows", "views"), [(5, 3), (1, 1)])
def test_rays_are_weighed_and_laid_back(device, rows, views, before):
    random = np.random.default_rng(3)
    pixels, bins = random.standard_normal((rows, WIDE)), random.standard_normal((views, WIDE))
    x, y = random.standard_normal(SHAPE), random.standard_normal((*SHAPE[:2], WIDE))
    factors = RayFactors(device, np.float32, pixels, bins, before)
    wide, narrow = device.empty(y.shape), device.empty(SHAPE)
    factors.widen(device.array(x), wide)
    np.testing.assert_allclose(wide.get(), weigh_rays(x, pixels, bins, before), rtol=1e-5)
    factors.narrow(device.array(y), narrow)
    spread = (wide.get().astype(np.float64) * y).sum()
    assert (narrow.get().astype(np.float64) * x).sum() == pytest.approx(spread, rel=1e-5)
    assert (wide.get()[..., :before] == 0).all()
