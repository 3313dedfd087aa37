"""Volumes that are damaged, hostile or too large are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
import zarr
from volume_files import FORMATS, SHAPE, VOLUME, save

from rift_cl.errors import (
    DTypeError,
    FileFormatError,
    InputError,
    PathEscapeError,
    ResourceLimitError,
    ShapeError,
)
from rift_cl.io import read_volume


@FORMATS
def test_reading_within_a_budget(tmp_path: Path, format: str) -> None:
    save(tmp_path / "v", format)
    with pytest.raises(ResourceLimitError, match="claims"):
        read_volume(tmp_path / "v", budget=VOLUME.nbytes - 1)
    assert read_volume(tmp_path / "v", budget=2 * VOLUME.nbytes).shape == SHAPE


def test_volumes_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_volume(tmp_path / "gone")
    with pytest.raises(FileFormatError, match="neither slices"):
        read_volume(tmp_path)
    (tmp_path / "text").write_text("text")
    with pytest.raises(FileFormatError, match="text"):
        read_volume(tmp_path / "text")
    save(tmp_path / "v", "tiff")
    (tmp_path / "v" / "slice_00002.tif").unlink()
    with pytest.raises(FileFormatError, match="slice 2 of 4"):
        read_volume(tmp_path / "v")
    (tmp_path / "v" / "slice_00002.tif").write_bytes(b"II*\0")
    with pytest.raises(FileFormatError, match="slice_00002"):
        read_volume(tmp_path / "v")


def test_a_store_that_would_unpickle(tmp_path: Path) -> None:
    header = {
        "zarr_format": 2,
        "shape": [1, 1, 1],
        "chunks": [1, 1, 1],
        "dtype": "<f4",
        "fill_value": 0,
        "order": "C",
        "filters": None,
        "compressor": {"id": "pickle"},
    }
    for place in (
        {"compressor": {"id": "pickle"}},
        {"filters": [{"id": "pickle", "name": "zstd"}]},
    ):
        folder = tmp_path / str(len(place)) / "z"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ".zarray").write_text(json.dumps({**header, "compressor": None, **place}))
        with pytest.raises(FileFormatError, match="pickle"):
            read_volume(folder)


def test_a_store_that_leads_outside(tmp_path: Path) -> None:
    save(tmp_path / "v", "zarr")
    (tmp_path / "secret").write_bytes(bytes(168))
    (tmp_path / "v" / "9").symlink_to(tmp_path / "secret")
    with pytest.raises(PathEscapeError, match="'9' leads outside"):
        read_volume(tmp_path / "v")


def test_terabytes_in_a_store(tmp_path: Path) -> None:
    for chunks in ((1, 10, 10), (10**4, 10**5, 10**5)):
        zarr.open_array(
            str(tmp_path / "z"), mode="w", shape=(10**4, 10**5, 10**5), chunks=chunks, dtype="f4"
        )
        with pytest.raises(ResourceLimitError, match="TiB"):
            read_volume(tmp_path / "z")


def test_pages_of_other_programs(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "one.tif", VOLUME, metadata=None)
    tifffile.imwrite(tmp_path / "shaped.tif", VOLUME)
    tifffile.imwrite(tmp_path / "swapped.tif", VOLUME, byteorder=">")
    tifffile.imwrite(tmp_path / "imagej.tif", VOLUME, imagej=True)
    with tifffile.TiffWriter(tmp_path / "apart.tif") as file:
        for page in VOLUME:
            file.write(page, contiguous=False)
    for path in tmp_path.glob("*.tif"):
        assert (read_volume(path) == VOLUME).all()
        with pytest.raises(ResourceLimitError, match=path.name):
            read_volume(path, budget=VOLUME.nbytes)


def test_pages_that_are_no_volume(tmp_path: Path) -> None:
    path = tmp_path / "v.tif"
    with tifffile.TiffWriter(path) as file:
        file.write(VOLUME[0])
        file.write(VOLUME[0, 1:])
    with pytest.raises(ShapeError, match="page 1"):
        read_volume(path)
    tifffile.imwrite(path, VOLUME, truncate=True)
    with pytest.raises(FileFormatError, match="5 pages"):
        read_volume(path)


def test_numbered_slices_of_other_programs(tmp_path: Path) -> None:
    for index, image in enumerate(VOLUME):
        tifffile.imwrite(tmp_path / f"cut{index + 8}.tiff", image)
    assert (read_volume(tmp_path) == VOLUME).all()
    tifffile.imwrite(tmp_path / "cut9.tiff", VOLUME)
    with pytest.raises(ShapeError, match=r"cut9\.tiff: has 5 pages"):
        read_volume(tmp_path)
    (tmp_path / "cut9.tiff").rename(tmp_path / "other9.tiff")
    with pytest.raises(FileFormatError, match="one series"):
        read_volume(tmp_path)
    (tmp_path / "other9.tiff").unlink()
    with pytest.raises(FileFormatError, match="slice 1 of 4"):
        read_volume(tmp_path)


def test_an_array_of_numpy(tmp_path: Path) -> None:
    for values in (VOLUME, np.asfortranarray(VOLUME), np.float64(VOLUME)):
        np.save(tmp_path / "v.npy", values)
        assert (read_volume(tmp_path / "v.npy") == VOLUME).all()
    with pytest.raises(ResourceLimitError, match=r"v\.npy"):
        read_volume(tmp_path / "v.npy", budget=VOLUME.nbytes - 1)
    np.save(tmp_path / "v.npy", VOLUME[0])
    with pytest.raises(ShapeError, match="wanted"):
        read_volume(tmp_path / "v.npy")
    np.save(tmp_path / "v.npy", np.array([None]), allow_pickle=True)
    with pytest.raises(DTypeError, match="object"):
        read_volume(tmp_path / "v.npy")
