"""The centre of rotation is found on phantoms, under noise and truncation, and on a real scan."""

import h5py
import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.reconstruct import attenuation, find_center

ANGLES = {
    "half turn": np.arange(90) * np.pi / 90,
    "full turn": np.arange(120) * 2 * np.pi / 120,
    "irregular": np.random.default_rng(1).uniform(0, 2 * np.pi, 150),
}


def _sinogram(angles, center, bins=128):
    scan = rift.Parallel(angles, bins, center=center)
    return rift.phantom.shepp_logan_sinogram(rift.Grid((100, 100)), scan)


@pytest.mark.parametrize("angles", ANGLES.values(), ids=ANGLES)
@pytest.mark.parametrize("center", [60.0, 64.3, 70.77])
def test_phantom(angles, center):
    assert find_center(_sinogram(angles, center), angles).center == pytest.approx(center, abs=0.3)


@pytest.mark.parametrize("center", [60.0, 66.6])
def test_noise(center):
    y = _sinogram(ANGLES["half turn"], center)
    noisy = y + np.random.default_rng(0).normal(0, 1, y.shape)
    assert find_center(noisy, ANGLES["half turn"]).center == pytest.approx(center, abs=0.5)


def test_truncated_detector():
    angles = ANGLES["half turn"]
    found = find_center(_sinogram(angles, 33.0, bins=80), angles)
    assert found.center == pytest.approx(33, abs=1.0)


def test_the_best_of_the_scores_is_the_answer():
    found = find_center(_sinogram(ANGLES["half turn"], 64.0), ANGLES["half turn"])
    assert found.scores[0, found.scores[1].argmax()] == pytest.approx(found.center, abs=0.1)
    assert found.interval[0] < found.center < found.interval[1]


def test_a_span_bounds_the_search():
    angles = ANGLES["half turn"]
    found = find_center(_sinogram(angles, 64.0), angles, span=(60, 70))
    assert found.center == pytest.approx(64, abs=0.1)
    with pytest.raises(InputError, match="span"):
        find_center(_sinogram(angles, 64.0), angles, span=(60, 200))


def test_a_sinogram_without_contrast_is_told():
    with pytest.raises(InputError, match="no contrast"):
        find_center(np.ones((10, 64), np.float32), np.linspace(0, 3, 10))


def test_non_finite_values_are_told():
    y = _sinogram(ANGLES["half turn"], 64.0)
    y[3, 4] = np.nan
    with pytest.raises(NonFiniteError, match=r"\(3, 4\)"):
        find_center(y, ANGLES["half turn"])


def test_real_tooth(shared_data):
    with h5py.File(shared_data / "tooth" / "tooth.h5") as file:
        frames = [
            file[f"exchange/{n}"][:].astype("f4") for n in ("data", "data_white", "data_dark")
        ]
        angles = np.deg2rad(file["exchange/theta"][:])
    y = attenuation(*frames).projections
    for row in range(y.shape[1]):
        assert find_center(y[:, row], angles).center == pytest.approx(296.0, abs=0.5)
