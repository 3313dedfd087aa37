"""A real cone-beam scan: a walnut (Meaney 2022, Zenodo 6986012, CC-BY 4.0), binned to 256 x 256."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rift_cl import Cone, Grid, Projector, cgls, fbp

pytestmark = [pytest.mark.once]


@pytest.fixture(scope="module")
def walnut(shared_data):
    """What gives line integrals and scan, averaged over blocks of pixels; lengths in mm."""
    path = shared_data / "walnut" / "walnut_cone.npz"
    if not path.is_file():
        pytest.skip(f"no real data: {path} is absent")
    with np.load(path) as file:
        sinogram, angles = file["sinogram"].astype(np.float32), file["angles"].astype(float)
        distances, pitch = (float(file["sid"]), float(file["sdd"])), float(file["du"])

    def averaged(block):
        n = 256 // block
        y = sinogram.reshape(-1, n, block, n, block).mean((2, 4))
        # The axis is seen at bin 128 of 256, half a bin beside the middle.
        center = (n - 1) / 2, 128.5 / block - 0.5
        scan = Cone(angles, n, n, block * pitch, *distances, center=center)
        return y, scan, Grid((n, n, n), scan.pitch[1] / scan.magnification)

    return averaged


def sharpness(volume):
    middle = volume[30:34].astype(float)
    return (np.diff(middle, axis=1) ** 2).mean() + (np.diff(middle, axis=2) ** 2).mean()


def test_the_axis_and_the_sense_are_those_that_make_it_sharp(device, walnut):
    y, scan, grid = walnut(4)
    thin = scan.subset(np.arange(0, 240, 2))
    found = {}
    for name, change in {
        "right": {},
        "backwards": {"angles": -thin.angles},
        "left of it": {"center": (31.5, scan.center[1] - 0.5)},
        "right of it": {"center": (31.5, scan.center[1] + 0.5)},
    }.items():
        A = Projector(grid, replace(thin, **change), device=device)
        found[name] = sharpness(fbp(A, y[:240:2]))
    assert max(found, key=found.get) == "right"
    assert found["backwards"] < 0.9 * found["right"]


@pytest.mark.full
def test_cgls_needs_a_sixth_of_the_views(device, walnut):
    y, scan, grid = walnut(2)
    best = fbp(Projector(grid, scan, device=device), y)
    few = Projector(grid, scan.subset(np.arange(0, 240, 6)), device=device)
    away = np.arange(128) - 63.5
    inside = (np.hypot(away[:, None], away) < 60)[None] & (np.abs(away) < 50)[:, None, None]

    def psnr(volume):
        return -10 * np.log10(
            np.mean((volume - best)[inside] ** 2) / np.percentile(best, 99.8) ** 2
        )

    assert psnr(cgls(few, y[:240:6], 10)) > psnr(fbp(few, y[:240:6])) + 3
