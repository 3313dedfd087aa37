"""Densities that hold what projections widen them by, beside the same splats dilated on a grid."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.geometry import Grid
from rift_cl.reference.voxels import voxelise
from rift_cl.train.xray.widening import Densities, widened

GRID, MEANS = Grid((9, 11, 13), 0.5), np.array([[0.2, -0.3, 0.1], [-0.8, 0.4, 0.6]])


def densities(modes: bool) -> Densities:
    random = np.random.default_rng(5)
    return Densities(
        np.log(random.uniform(0.2, 0.9, (2, 3))).astype(np.float32),
        random.normal(size=(2, 4)).astype(np.float32),
        random.normal(size=2).astype(np.float32),
        (0.3 * random.normal(size=(2, 9))).astype(np.float32) if modes else None,
    )


def volume(splats: Densities, dilation=0.0):
    scales, peaks = np.exp(splats.log_scales), np.exp(splats.logit_opacities)
    given = MEANS, splats.quats, scales, peaks, GRID
    return voxelise(*given, shape_modes=splats.shape_modes, dilation=np.array(dilation))


@pytest.mark.each
@pytest.mark.parametrize(
    ("modes", "variances"),
    [(False, (0.1, 0.1, 0.1)), (True, (0.1, 0.1, 0.1)), (False, (0.1, 0.1, 0.9)), (True, (0,) * 3)],
)
def test_wider_splats_are_what_dilation_makes_of_them(modes, variances) -> None:
    splats = densities(modes)
    found = widened(splats, variances)
    assert found is not None
    wanted = volume(splats, variances)
    np.testing.assert_allclose(volume(found), wanted, atol=1e-6 * np.abs(wanted).max())


def test_modes_keep_the_axes_that_they_are_in() -> None:
    assert widened(densities(True), (0.1, 0.1, 0.9)) is None
