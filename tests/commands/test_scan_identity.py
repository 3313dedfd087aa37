"""A scan is another one once its content changed, even where its time and size did not."""

import os

import h5py
import numpy as np
import pytest

from rift_cl.commands.inputs.scan_rows import scan_identity
from rift_cl.io import open_scan


@pytest.fixture
def stored(tmp_path):
    """Stores projections in one file, whose time is always the same."""

    def store(projections):
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            file["exchange/data"] = np.asarray(projections, np.float32)
            file["exchange/theta"] = np.arange(len(projections)) * 180 / len(projections)
        os.utime(path, ns=(10**18, 10**18))
        return scan_identity(open_scan(path, kind="attenuation"))

    return store


def test_the_same_content_is_the_same_scan(stored):
    values = np.random.default_rng(0).random((12, 2, 16))
    assert stored(values) == stored(values)


def test_other_content_of_the_same_size_and_time_is_another_scan(stored):
    values = np.random.default_rng(0).random((12, 2, 16))
    assert stored(values) != stored(values[::-1])


def test_another_number_of_rows_at_the_same_time_is_another_scan(stored):
    values = np.zeros((12, 2, 16))
    assert stored(values) != stored(np.zeros((12, 3, 16)))


def test_a_large_file_that_changed_anywhere_wide_is_another_scan(stored):
    values = np.zeros((40, 64, 512))
    changed = values.copy()
    changed[17:21] = 1
    assert stored(values) != stored(changed)
