"""The packed record of a splat on the screen: against its twin, and the ellipse that it bounds."""

import dataclasses

import numpy as np
import pytest
from hermite_scenes import whitening
from scenes import FARTHEST, random_scene

from rift_cl.reference.screen_record import screen_records
from rift_cl.splat.raster import ScreenModes, packed

SIZE = (50, 70)


def records_of(device, scene, table=None):
    splats, _ = scene.upload(device)
    if table is not None:
        splats = dataclasses.replace(splats, modes=ScreenModes(device.array(table), 1))
    return device.get(packed(device, splats).records)


@pytest.mark.parametrize("channels", [1, 5, 7])
def test_records_equal_their_twin(device, channels):
    scene = random_scene(300, SIZE, channels=channels, weights=(1e-30, 3.0))
    expected = screen_records(scene.screen.astype(float), scene.features.astype(float))
    np.testing.assert_allclose(records_of(device, scene), expected, rtol=2e-5, atol=1e-6)


def test_modes_give_their_own_whitening(device):
    scene = random_scene(50, SIZE)
    given = whitening(scene.screen) * 1.25
    table = np.concatenate([given, np.zeros((50, 2))], axis=1).astype(np.float32)
    expected = screen_records(scene.screen.astype(float), scene.features.astype(float), given)
    np.testing.assert_allclose(records_of(device, scene, table), expected, rtol=2e-5, atol=1e-6)


def test_a_record_bounds_its_ellipse(device):
    """Rows at any column lie within the ellipse's own, and touch the box where they should."""
    scene = random_scene(100, SIZE)
    slope, summit, reach, extent, per_extent = records_of(device, scene).astype(float)[:, 6:11].T
    a, b, c = scene.screen.astype(float)[:, 2:5].T
    for share in (-0.99, -0.3, 0, 0.5, 0.9):
        u = share * extent
        inside = np.maximum(FARTHEST**2 / c - (a * c - b**2) * (u / c) ** 2, 0)
        half = reach * np.sqrt(1 - (u * per_extent) ** 2)
        assert (half >= np.sqrt(inside) * (1 - 1e-5)).all()
        np.testing.assert_allclose(slope * u, -b / c * u, rtol=1e-5)
        np.testing.assert_allclose(half, np.sqrt(inside), rtol=1e-3)
    top = slope * summit + reach * np.sqrt(1 - (summit * per_extent) ** 2)
    np.testing.assert_allclose(top, scene.screen[:, 7], rtol=1e-3)
