"""Every order of the axes gives the same rows, in every format that can hold it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations
from pathlib import Path
from typing import Any

import h5py
import mrcfile
import numpy as np
import pytest
import tiff_files
from mat_files import write_mat

from rift_cl.io import open_scan

# No two sizes are the same.
VIEWS, ROWS, BINS = 7, 4, 9
DATA = np.random.default_rng(0).integers(100, 3000, (VIEWS, ROWS, BINS)).astype("i2")
FLATS = np.random.default_rng(1).integers(3000, 3100, (3, ROWS, BINS)).astype("i2")
DEGREES = np.arange(VIEWS) * 180.0 / VIEWS
NAMES = ("angle", "row", "bin")


def hdf5(folder: Path, data: np.ndarray, flats: np.ndarray) -> Path:
    with h5py.File(folder / "a.h5", "w") as file:
        file.create_dataset("p", data=data, chunks=tuple(min(2, n) for n in data.shape))
        file["theta"], file["flats"] = DEGREES, flats
    return folder / "a.h5"


def npz(folder: Path, data: np.ndarray, flats: np.ndarray) -> Path:
    np.savez(folder / "a.npz", p=np.asfortranarray(data), theta=DEGREES, flats=flats)
    return folder / "a.npz"


def mat5(folder: Path, data: np.ndarray, flats: np.ndarray) -> Path:
    return write_mat(folder / "a.mat", {"p": data, "theta": DEGREES, "flats": flats}, "5")


def mat73(folder: Path, data: np.ndarray, flats: np.ndarray) -> Path:
    return write_mat(folder / "a.mat", {"p": data, "theta": DEGREES, "flats": flats}, "7.3")


def tiff(folder: Path, data: np.ndarray, flats: np.ndarray) -> Path:
    np.savetxt(folder / "angles.txt", DEGREES)
    tiff_files.write_pages(folder / "flats.tif", flats)
    return tiff_files.write_pages(folder / "a.tif", data)


def mrc(folder: Path, data: np.ndarray, flats: np.ndarray) -> Path:
    np.savetxt(folder / "a.tlt", DEGREES)
    with mrcfile.new(folder / "a.mrc") as file:
        file.set_data(np.ascontiguousarray(data))
    return folder / "a.mrc"


WRITERS = (hdf5, npz, mat5, mat73, tiff, mrc)


@pytest.mark.parametrize("order", list(permutations(range(3))), ids=str)
@pytest.mark.parametrize("write", WRITERS)
def test_stacks(tmp_path: Path, write: Callable[..., Path], order: tuple[int, ...]) -> None:
    path = write(tmp_path, DATA.transpose(order), FLATS.transpose(order))
    options: dict[str, Any] = {"axes": ",".join(NAMES[axis] for axis in order)}
    if write in (hdf5, npz, mat5, mat73):
        options["dataset"] = "p"
    if write is mrc:
        options["kind"] = "attenuation"
    scan = open_scan(path, **options)
    assert scan.shape == DATA.shape
    for start, stop in ((0, ROWS), (1, 3), (ROWS - 1, ROWS)):
        rows = scan.read(start, stop)
        np.testing.assert_array_equal(rows.projections, DATA[:, start:stop])
        if write is not mrc:
            np.testing.assert_array_equal(rows.flats, FLATS[:, start:stop])
            assert rows.flats.flags.c_contiguous
        assert rows.projections.dtype == np.float32 and rows.projections.flags.c_contiguous
    looked = scan.rows.look("projections", [0, 2, VIEWS - 1], [0, ROWS - 1])
    np.testing.assert_array_equal(looked, DATA[[0, 2, VIEWS - 1]][:, [0, ROWS - 1]])
    said = np.array(NAMES)[list(order)]
    assert f"axes ({', '.join(said)})" in scan.notes[0]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("write", [hdf5, npz, mat5, mat73, tiff])
def test_sinograms(tmp_path: Path, write: Callable[..., Path], turned: bool) -> None:
    data, flats = DATA[:, 1], FLATS[:, 1]
    if write is tiff:
        data, flats = data[None], flats[None]
    if turned:
        data, flats = np.swapaxes(data, -1, -2), np.swapaxes(flats, -1, -2)
    path = write(tmp_path, data, flats)
    scan = open_scan(path, dataset=None if write is tiff else "p")
    rows = scan.read(0, 1)
    np.testing.assert_array_equal(rows.projections[:, 0], DATA[:, 1])
    np.testing.assert_array_equal(rows.flats[:, 0], FLATS[:, 1])
    assert scan.kind == "counts"


@pytest.mark.parametrize("write", [hdf5, npz, mat5, mat73])
def test_keys_sort_frames_along_any_axis(tmp_path: Path, write: Callable[..., Path]) -> None:
    frames = np.concatenate([FLATS[:2], DATA[:3], FLATS[2:], DATA[3:]])
    keys = np.repeat([1, 0, 1, 0], [2, 3, 1, 4])
    turned = frames.transpose(1, 2, 0)
    path = write(tmp_path, turned, FLATS)
    extra = tmp_path / f"keyed{path.suffix}"
    values = {"p": turned, "theta": DEGREES, "k": keys}
    if write is hdf5:
        with h5py.File(extra, "w") as file:
            for name, value in values.items():
                file[name] = value
    elif write is npz:
        np.savez(extra, **values)
    else:
        write_mat(extra, values, "5" if write is mat5 else "7.3")
    scan = open_scan(extra, dataset="p", theta="theta", image_key="k", axes="row,bin,angle")
    rows = scan.read(1, 3)
    np.testing.assert_array_equal(rows.projections, DATA[:, 1:3])
    np.testing.assert_array_equal(rows.flats, FLATS[:, 1:3])
    np.testing.assert_array_equal(scan.flats_at, [0, 0, 3])
