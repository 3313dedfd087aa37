"""Small scans that the tests write, with what they hold."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

FRAMES, ROWS, BINS = 6, 4, 5
DEGREES = np.linspace(0, 150, FRAMES)


def counts(*shape: int, dtype: str = "<u2") -> np.ndarray:
    """Numbers that are all different, so that every misplaced row shows."""
    return np.arange(np.prod(shape)).reshape(shape).astype(dtype)


def data_exchange(path: Path, dtype: str = "<u2") -> np.ndarray:
    data = counts(FRAMES, ROWS, BINS, dtype=dtype)
    with h5py.File(path, "w") as file:
        file["exchange/data"] = data
        file["exchange/data_white"] = counts(2, ROWS, BINS) + 2000
        file["exchange/data_dark"] = counts(3, ROWS, BINS) + 1000
        file["exchange/theta"] = DEGREES
        file["exchange/theta"].attrs["units"] = "degrees"
    return data


KEYS = np.array([2, 1, 0, 0, 3, 0, 1, 0])


def nxtomo(path: Path, *, group: str = "entry1/tomo_entry", mode: str = "w") -> np.ndarray:
    data = counts(len(KEYS), ROWS, BINS)
    with h5py.File(path, mode) as file:
        entry = file.require_group(group)
        entry["instrument/detector/data"] = data
        entry["instrument/detector/image_key"] = KEYS
        entry["instrument/detector/x_pixel_size"] = 3.5
        entry["instrument/detector/x_pixel_size"].attrs["units"] = "um"
        entry["sample/rotation_angle"] = np.arange(len(KEYS)) * 10.0
        entry["sample/rotation_angle"].attrs["units"] = np.bytes_("degree")
    return data


def npz(path: Path) -> np.ndarray:
    data = counts(FRAMES, ROWS, BINS, dtype="<f4")
    flats = counts(2, ROWS, BINS, dtype="<f8") + 500
    np.savez_compressed(path, projections=data, angles=np.deg2rad(DEGREES), flats=flats, pitch=0.25)
    return data
