"""Binned projections are those of a coarser detector."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.metrics import psnr
from rift_cl.reconstruct.preprocess.binning import (
    binned,
    binned_center,
    binned_scan,
    binning_note,
)


@pytest.mark.parametrize("dtype", ["uint16", "int32", "float32"])
@pytest.mark.parametrize(("rows", "bins"), [(1, 1), (2, 3), (3, 1), (4, 4)])
def test_means_of_blocks(dtype: str, rows: int, bins: int) -> None:
    frames = np.random.default_rng(1).integers(0, 60000, (5, 9, 14)).astype(dtype)
    got = binned(frames, rows=rows, bins=bins)
    assert got.dtype == np.float32
    for r in range(9 // rows):
        for b in range(14 // bins):
            block = frames[:, r * rows : (r + 1) * rows, b * bins : (b + 1) * bins]
            np.testing.assert_allclose(got[:, r, b], block.mean(axis=(1, 2)), rtol=1e-6)
    assert got.shape == (5, 9 // rows, 14 // bins)


@pytest.mark.parametrize("bins", [2, 3, 5])
@pytest.mark.parametrize("center", [118.0, 131.37])
def test_every_ray_stays_where_it_is(bins: int, center: float) -> None:
    scan = rift.Parallel([0.0, 1.0], 251, pitch=0.02, center=center)
    t = scan.coordinates()[: 251 // bins * bins].reshape(-1, bins).mean(axis=1)
    coarse = binned_scan(scan, bins)
    np.testing.assert_allclose(coarse.coordinates(), t, atol=1e-12)
    assert coarse.center == binned_center(center, bins)


def test_the_slice_does_not_move() -> None:
    grid = rift.Grid((64, 64), 2.0)
    angles = np.arange(180) * np.pi / 180
    scan = rift.Parallel(angles, 161, center=77.3)
    sinogram = rift.phantom.shepp_logan_sinogram(rift.Grid((128, 128)), scan).astype(np.float32)
    coarse = binned_scan(scan, 2)
    image = rift.fbp(rift.Projector(grid, coarse, "strip"), binned(sinogram[:, None], bins=2)[:, 0])
    truth = rift.phantom.shepp_logan(rift.Grid((128, 128))).reshape(64, 2, 64, 2).mean(axis=(1, 3))
    moved = rift.Parallel(angles, 80, 2.0, coarse.center + 0.25)
    worse = rift.fbp(rift.Projector(grid, moved, "strip"), binned(sinogram[:, None], bins=2)[:, 0])
    assert psnr(image, truth) > 27
    assert psnr(image, truth) > psnr(worse, truth) + 1


def test_what_is_left_out() -> None:
    assert binning_note(8, 12, rows=2, bins=3) == ""
    note = binning_note(9, 14, rows=2, bins=4)
    assert note == "Binning leaves out the last 1 row and the last 2 bins of the detector."


@pytest.mark.parametrize(("rows", "bins"), [(0, 1), (1, -2), (1.5, 1), (True, 0)])
def test_blocks_of_nothing(rows: int, bins: int) -> None:
    with pytest.raises(InputError, match="whole number"):
        binned(np.zeros((2, 4, 4)), rows=rows, bins=bins)


def test_blocks_larger_than_the_detector() -> None:
    with pytest.raises(ShapeError, match="smaller than the 2 x 9"):
        binned(np.zeros((2, 4, 8)), rows=2, bins=9)
